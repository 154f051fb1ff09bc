//! A finished map as the evaluation reads it.

use std::collections::BTreeSet;

use geometry::Cell;
use mapping::{Mapper, is_occupied};
use messages::{Layer, TILE_EDGE};

/// Which cells of a map are occupied, and which were touched at all.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Occupancy {
    /// Occupied by [`mapping::is_occupied`].
    pub occupied: BTreeSet<Cell>,
    /// P other than 0.5.
    pub touched: BTreeSet<Cell>,
}

impl Occupancy {
    /// Of a layer as it is shown.
    #[must_use]
    pub fn of(mapper: &Mapper, layer: Layer) -> Self {
        let mut occupancy = Self::default();
        for tile in mapper.shown_tiles(layer) {
            for (index, log_odds) in tile.log_odds.iter().enumerate() {
                let (row, column) = ((index / TILE_EDGE) as i32, (index % TILE_EDGE) as i32);
                let edge = TILE_EDGE as i32;
                let cell = Cell { row: tile.row * edge + row, column: tile.column * edge + column };
                if is_occupied(*log_odds) {
                    occupancy.occupied.insert(cell);
                }
                if *log_odds != 0.0 {
                    occupancy.touched.insert(cell);
                }
            }
        }
        occupancy
    }
}
