//! One drive, judged.

use mapping::export::MapCopy;
use messages::Layer;

use crate::causes::Causes;
use crate::detection::{Detection, track_errors_m};
use crate::drive::Drive;
use crate::judge::{Chain, FilterError, Outcome, judge, mapped, oracle, unfiltered};
use crate::occupancy::Occupancy;
use crate::score::{Labels, Tally};

/// Farthest walker whose track counts, m: the reach of the sonars.
const REACH_M: f64 = 3.0;

/// What came of a drive.
#[derive(Debug, Clone)]
pub struct Trial {
    /// The map and the verdicts, counted.
    pub tally: Tally,
    /// The wrong verdicts, counted.
    pub causes: Causes,
    /// STD, counted.
    pub detection: Detection,
    /// Distances of the walkers' places from the nearest track, m, in ascending order.
    pub track_errors_m: Vec<f64>,
    /// Both layers of the map with the robot's and the walkers' ways.
    pub map: MapCopy,
}

impl Trial {
    /// Judges what the processes said of a drive. `reference` is the map of the same drive without walkers; where there is
    /// none, that of the true labels stands in for it.
    ///
    /// # Errors
    /// Parameters or verdicts that the mapper refuses.
    pub fn judge(drive: &Drive, outcome: &Outcome, reference: Option<&Occupancy>, chain: &Chain) -> Result<Self, FilterError> {
        let mapper = mapped(drive, &chain.mapping, &outcome.verdicts)?;
        let truth = judge(drive, &chain.mapping, &oracle(drive))?;
        let labels = Labels::new(&drive.truth, mapper.cell_size());
        let [map, before] = [Layer::Filtered, Layer::Unfiltered].map(|layer| Occupancy::of(&mapper, layer));
        let mut tally = labels.tally(&map, &before, &truth, reference.unwrap_or(&truth));
        tally.count_verdicts(drive, &outcome.verdicts);
        let mut track_errors_m = track_errors_m(drive, &outcome.tracks_m, REACH_M);
        track_errors_m.sort_by(f64::total_cmp);
        let mut map = MapCopy::of(&mapper);
        map.set_walkers(drive.truth.walkers_m.clone());
        let causes = Causes::count(drive, &outcome.verdicts);
        Ok(Self { tally, causes, detection: Detection::count(drive, &outcome.motions, chain.std.aside_rad), track_errors_m, map })
    }
}

/// The map of a drive without walkers.
///
/// # Errors
/// Parameters that the mapper refuses.
pub fn reference(drive: &Drive, parameters: &mapping::Parameters) -> Result<Occupancy, FilterError> {
    judge(drive, parameters, &unfiltered(drive))
}
