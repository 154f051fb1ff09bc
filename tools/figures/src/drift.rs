//! What localisation makes of odometry that drifts: the map of one drive by odometry, and by localisation's poses.

use evaluate::{Drive, LocalisationScore, Localised, Variation, mapped, read_world, unfiltered};
use localisation::Parameters;
use messages::{Layer, Pose};
use simulator::Body;

use crate::panels;
use crate::scenes::{Cells, Error, cells};

/// A loop of corridors around a block of rooms.
const BLOCK: &str = include_str!("../../../config/worlds/block.toml");
/// Distances 2 % too long, turns 4 % too large, a heading that wanders by 3°/√m.
const DRIFT: &str = "\n[odometry]\ndistance_share = 0.02\nturn_share = 0.04\nwander_deg = 3.0\n";
const SEED: u64 = 1;
/// The sonars of a Pioneer 1 are not reliable beyond it, m.
const RANGE_LIMIT_M: f64 = 3.0;

pub(crate) fn figure() -> Result<String, Error> {
    let world = read_world(&format!("{BLOCK}{DRIFT}"), Variation { walkers: Some(0), seed: SEED, stand_s: None })?;
    let drive = Drive::through(&world, &Body::of(&psos::MODELS[0]), RANGE_LIMIT_M, None, SEED);
    let localised = Localised::of(&drive, Parameters { enabled: true, ..Parameters::default() })?;
    let parameters = mapping::Parameters::default();
    let verdicts = unfiltered(&drive);
    let score = LocalisationScore::of(&drive, &localised, &verdicts, &parameters)?;
    let map =
        |poses: &[Pose]| -> Result<Cells, Error> { Ok(cells(&mapped(&drive.placed(poses), &parameters, &verdicts)?, Layer::Filtered)) };
    let words = format!(
        "config/worlds/block.toml without people, seed {SEED}, {:.0} m. Root mean square error of the poses: {:.2} m and {:.2} m. \
         Sonars only.",
        score.path_m, score.error.odometry.distance_m, score.error.last.distance_m
    );
    let (by_odometry, by_localisation) = (map(&drive.odometry())?, map(&localised.last)?);
    panels::figure([(&by_odometry, "(a) by odometry"), (&by_localisation, "(b) by localisation")], &words)
}
