//! Fig. 10: the map of a hall with people in it, without and with the filter.

use evaluate::{CameraSetup, Chain, Drive, filter, mapped};
use mapping::Mapper;
use messages::Layer;
use simulator::{Body, Optics};

use crate::detection::optics;
use crate::raster;
use crate::scenes::{Cells, Error, cells};
use crate::svg::{Anchor, DIM, INK, Svg};

/// The world of the demo: a hall with pillars, in which people lead the robot, stand about and cross its way.
const HALL: &str = include_str!("../../../config/worlds/hall.toml");
const SEED: u64 = 1;
/// Cells kept around what is known.
const MARGIN: i32 = 4;
const WIDTH: f64 = 1080.0;
const LEFT: f64 = 14.0;

pub(crate) fn figure() -> Result<String, Error> {
    let (drive, mapper) = drive()?;
    let layers = [Layer::Unfiltered, Layer::Filtered].map(|layer| cells(&mapper, layer));
    let known = || layers.iter().flat_map(Cells::keys);
    let rows = (known().map(|cell| cell.0).min().unwrap_or(0) - MARGIN)..=(known().map(|cell| cell.0).max().unwrap_or(0) + MARGIN);
    let columns = (known().map(|cell| cell.1).min().unwrap_or(0) - MARGIN)..=(known().map(|cell| cell.1).max().unwrap_or(0) + MARGIN);
    let edge = 0.5 * (WIDTH - 3.0 * LEFT) / f64::from(columns.end() - columns.start() + 1);
    let height = edge * f64::from(rows.end() - rows.start() + 1);

    let mut svg = Svg::new(WIDTH, height + 72.0);
    let titles = ["(a) every echo counts", "(b) what moves is filtered out"];
    for (panel, (cells, title)) in layers.iter().zip(titles).enumerate() {
        let (left, top) = (LEFT + panel as f64 * 0.5 * (WIDTH - LEFT), 36.0);
        svg.text([left, top - 9.0], Anchor::Start, 14.0, INK, title);
        let shade = |row, column| Some(raster::grey(cells.get(&(row, column)).copied().unwrap_or(0.4)));
        raster::draw(&mut svg, [left, top], edge, rows.clone().rev().map(|row| columns.clone().map(|column| shade(row, column)).collect()));
    }
    let counts = mapper.counts();
    let words = format!(
        "config/worlds/hall.toml, seed {SEED}: {} scans, {} readings, the occupied part of {} of them withheld. Cells of 50 mm.",
        drive.scans.len(),
        counts.readings,
        counts.withheld
    );
    svg.text([LEFT, height + 60.0], Anchor::Start, 12.0, DIM, &words);
    Ok(svg.finish())
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
