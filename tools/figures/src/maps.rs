//! Fig. 10: the map of a hall with people in it, without and with the filter.

use evaluate::{CameraSetup, Chain, Drive, filter, mapped};
use mapping::Mapper;
use messages::Layer;
use simulator::{Body, Optics};

use crate::detection::optics;
use crate::panels;
use crate::scenes::{Error, cells};

/// The world of the demo: a hall with pillars, in which people lead the robot, stand about and cross its way.
const HALL: &str = include_str!("../../../config/worlds/hall.toml");
const SEED: u64 = 1;

pub(crate) fn figure() -> Result<String, Error> {
    let (drive, mapper) = drive()?;
    let [unfiltered, filtered] = [Layer::Unfiltered, Layer::Filtered].map(|layer| cells(&mapper, layer));
    let counts = mapper.counts();
    let words = format!(
        "config/worlds/hall.toml, seed {SEED}: {} scans, {} readings, the occupied part of {} of them withheld. Cells of 50 mm.",
        drive.scans.len(),
        counts.readings,
        counts.withheld
    );
    panels::figure([(&unfiltered, "(a) every echo counts"), (&filtered, "(b) what moves is filtered out")], &words)
}

/// A drive with the filter's verdicts, and the map of it, both layers.
fn drive() -> Result<(Drive, Mapper), Error> {
    let world = world_file::parse("hall.toml", HALL)?;
    let optics = Optics { interval_ns: 66_666_667, ..optics() };
    let camera = CameraSetup::new(optics);
    let chain = Chain::default();
    let drive = Drive::through(&world, &Body::of(&psos::MODELS[0]), chain.fti.range_limit_m, Some(&camera), SEED);
    let mapper = mapped(&drive, &chain.mapping, &filter(&drive, &chain)?.verdicts)?;
    Ok((drive, mapper))
}
