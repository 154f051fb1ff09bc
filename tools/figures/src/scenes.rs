//! What several figures share: maps made by the mapper itself, and how they are read.

use mapping::{Input, Mapper, Parameters, SensorParameters};
use messages::{Layer, Pose, SonarReading, SonarScan, TILE_EDGE};
use std::collections::BTreeMap;

/// A corridor with people in it.
pub(crate) const CORRIDOR: &str = include_str!("../../../config/worlds/corridor.toml");

/// Whatever a part refuses with.
pub(crate) type Error = Box<dyn std::error::Error + Send + Sync>;

/// Occupancy of a map's cells by row and column; unknown ones are left out.
pub(crate) type Cells = BTreeMap<(i32, i32), f64>;

/// The paper's sensor model: far readings say as much as near ones.
pub(crate) fn paper_parameters(cell_m: f64, half_beam_deg: f64) -> Parameters {
    let sensor = SensorParameters { fades: None, ..SensorParameters::default() };
    Parameters { cell_m, half_beam_rad: half_beam_deg.to_radians(), sensor, ..Parameters::default() }
}

/// An echo straight ahead of a sonar that sits half a cell to the left of the origin: cells lie on its axis.
pub(crate) fn echo_ahead(cell_m: f64, range_m: f64) -> SonarScan {
    let reading = SonarReading { range_m, echo: 1, ..SonarReading::default() };
    SonarScan::new(Pose { y_m: 0.5 * cell_m, ..Pose::default() }, &[reading], false)
}

/// The map of scans, a tenth of a second apart.
pub(crate) fn map_of<'a>(parameters: &Parameters, scans: impl IntoIterator<Item = &'a SonarScan>) -> Result<Mapper, Error> {
    let mut mapper = Mapper::new(parameters)?;
    for (seq, scan) in (1..).zip(scans) {
        mapper.step(Input::Scan { seq, stamp_ns: seq * 100_000_000, scan })?;
    }
    mapper.step(Input::End)?;
    mapper.refresh();
    Ok(mapper)
}

/// What a layer of the map says of each cell.
pub(crate) fn cells(mapper: &Mapper, layer: Layer) -> Cells {
    let edge = TILE_EDGE as i32;
    let known = mapper.shown_tiles(layer).flat_map(|tile| {
        let values: Vec<f32> = tile.log_odds.to_vec();
        values.into_iter().enumerate().filter(|(_, log_odds)| *log_odds != 0.0).map(move |(index, log_odds)| {
            let (row, column) = (index as i32 / edge, index as i32 % edge);
            ((tile.row * edge + row, tile.column * edge + column), 1.0 / (1.0 + (-f64::from(log_odds)).exp()))
        })
    });
    known.collect()
}
