//! The map of a log as a `nav_msgs/msg/OccupancyGrid`.

use std::collections::BTreeMap;

use messages::{MapTile, TILE_CELLS, TILE_EDGE};
use serde::Serialize;

use crate::cdr;
use crate::interfaces::{Header, Pose, Quaternion, Time, Vector3};

/// The largest map that is written, cells: 400 m × 400 m in cells of 5 cm.
const MAX_CELLS: usize = 64 << 20;
/// A cell of which nothing is known.
const UNKNOWN: i8 = -1;

/// The grid without its cells, which follow.
#[derive(Debug, Clone, PartialEq, Serialize)]
struct GridHead {
    header: Header,
    map_load_time: Time,
    resolution: f32,
    width: u32,
    height: u32,
    origin: Pose,
}

/// A layer of the map, put together from its tiles.
#[derive(Debug, Clone, Default)]
pub(crate) struct Occupancy {
    /// By row and column of the tile.
    tiles: BTreeMap<(i32, i32), Box<[i8; TILE_CELLS]>>,
    cell_m: f64,
    is_new: bool,
}

impl Occupancy {
    /// Takes a tile in.
    pub(crate) fn take(&mut self, tile: &MapTile) {
        if self.cell_m.to_bits() != tile.cell_m.to_bits() {
            self.tiles.clear();
            self.cell_m = tile.cell_m;
        }
        self.tiles.insert((tile.row, tile.column), Box::new(tile.log_odds.map(percent)));
        self.is_new = true;
    }

    /// The message, if a tile has come since the last; `Err` with the number of cells if these are too many.
    pub(crate) fn draw(&mut self, stamp: Time) -> Result<Option<Vec<u8>>, usize> {
        let rows = self.tiles.keys().map(|(row, _)| *row);
        let columns = self.tiles.keys().map(|(_, column)| *column);
        let (Some(bottom), Some(top)) = (rows.clone().min(), rows.max()) else { return Ok(None) };
        let (Some(left), Some(right)) = (columns.clone().min(), columns.max()) else { return Ok(None) };
        if !std::mem::take(&mut self.is_new) {
            return Ok(None);
        }
        let height = (top.abs_diff(bottom) as usize + 1) * TILE_EDGE;
        let width = (right.abs_diff(left) as usize + 1) * TILE_EDGE;
        let count = width.saturating_mul(height);
        if count > MAX_CELLS {
            return Err(count);
        }
        let mut cells = vec![UNKNOWN.cast_unsigned(); count];
        for ((row, column), tile) in &self.tiles {
            let (y, x) = (row.abs_diff(bottom) as usize * TILE_EDGE, column.abs_diff(left) as usize * TILE_EDGE);
            for (line, values) in tile.chunks(TILE_EDGE).enumerate() {
                let start = (y + line) * width + x;
                cells[start..start + TILE_EDGE].iter_mut().zip(values).for_each(|(cell, value)| *cell = value.cast_unsigned());
            }
        }
        let edge_m = TILE_EDGE as f64 * self.cell_m;
        let at = Vector3 { x: f64::from(left) * edge_m, y: f64::from(bottom) * edge_m, z: 0.0 };
        let head = GridHead {
            header: Header { stamp, frame_id: "map".to_owned() },
            map_load_time: stamp,
            resolution: self.cell_m as f32,
            width: width as u32,
            height: height as u32,
            origin: Pose { position: at, orientation: Quaternion::default() },
        };
        Ok(Some(cdr::encode_with_bytes(&head, &cells)))
    }
}

/// The probability that a cell is occupied, in percent.
fn percent(log_odds: f32) -> i8 {
    if log_odds == 0.0 {
        return UNKNOWN;
    }
    (100.0 / (1.0 + (-log_odds).exp())).round() as i8
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_tile_lies_at_its_place_in_percent() {
        let mut occupancy = Occupancy::default();
        let mut tile = MapTile { cell_m: 0.05, row: -1, column: 2, ..MapTile::default() };
        tile.log_odds[0] = 2.0;
        tile.log_odds[1] = -2.0;
        occupancy.take(&tile);
        tile.column = 3;
        occupancy.take(&tile);
        let data = occupancy.draw(Time::default()).unwrap().unwrap();
        let cells = &data[data.len() - 2 * TILE_CELLS..];
        assert_eq!([cells[0], cells[1], cells[2]].map(u8::cast_signed), [88, 12, UNKNOWN]);
        assert_eq!(cells[TILE_EDGE].cast_signed(), 88, "the second tile is to the right");
        assert_eq!(occupancy.draw(Time::default()), Ok(None), "nothing is new");
    }

    #[test]
    fn a_map_that_is_too_large_is_refused() {
        let mut occupancy = Occupancy::default();
        for column in [-100_000, 100_000] {
            occupancy.take(&MapTile { cell_m: 0.05, column, row: column, ..MapTile::default() });
        }
        assert!(occupancy.draw(Time::default()).is_err());
    }
}
