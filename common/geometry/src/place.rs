//! Metres, cells and tiles.

use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

use crate::tile::{TILE_EDGE, TILE_EDGE_LOG2};

/// Edge of a cell in metres: finite and above 0.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CellSize(f64);

/// A number that is no edge of a cell.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[error("edge of a cell is {found} m, expected a finite number above 0")]
pub struct CellSizeError {
    /// The number.
    pub found: f64,
}

/// A cell by its place in the lattice; its order is that of rows, then columns.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize, Schema)]
pub struct Cell {
    /// Along y of the map frame.
    pub row: i32,
    /// Along x of the map frame.
    pub column: i32,
}

/// A tile by its place: tile 0 begins with cell 0. Its order is that of rows, then columns.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct TileKey {
    /// Along y of the map frame.
    pub row: i32,
    /// Along x of the map frame.
    pub column: i32,
}

impl CellSize {
    /// An edge of `metres`.
    ///
    /// # Errors
    /// Not finite, or not above 0.
    pub fn new(metres: f64) -> Result<Self, CellSizeError> {
        if metres.is_finite() && metres > 0.0 { Ok(Self(metres)) } else { Err(CellSizeError { found: metres }) }
    }

    /// In metres.
    #[must_use]
    pub fn metres(self) -> f64 {
        self.0
    }

    /// Row or column of the cell that covers this coordinate; places further than 2³¹ cells away count as the last.
    #[must_use]
    pub fn index_of(self, metres: f64) -> i32 {
        (metres / self.0).floor() as i32
    }

    /// Coordinate of the centre of a row or column, m.
    #[must_use]
    pub fn centre_of(self, index: i32) -> f64 {
        (f64::from(index) + 0.5) * self.0
    }

    /// The cell that covers a place, given in metres.
    #[must_use]
    pub fn cell_at(self, x_m: f64, y_m: f64) -> Cell {
        Cell { row: self.index_of(y_m), column: self.index_of(x_m) }
    }
}

impl Cell {
    /// The tile that holds this cell.
    #[must_use]
    pub fn tile(self) -> TileKey {
        TileKey { row: self.row >> TILE_EDGE_LOG2, column: self.column >> TILE_EDGE_LOG2 }
    }

    /// Where this cell is within its tile, row by row.
    pub(crate) fn offset(self) -> usize {
        within_tile(self.row) * TILE_EDGE + within_tile(self.column)
    }
}

impl TileKey {
    /// The first cell of this tile, at its smallest x and y; `None` for a tile beyond the last cell there is.
    #[must_use]
    pub fn first_cell(self) -> Option<Cell> {
        let edge = TILE_EDGE as i32;
        Some(Cell { row: self.row.checked_mul(edge)?, column: self.column.checked_mul(edge)? })
    }
}

/// Row or column within its tile.
pub(crate) fn within_tile(index: i32) -> usize {
    (index & (TILE_EDGE as i32 - 1)) as usize
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn a_cell_covers_from_its_edge_to_the_next() {
        let cell = CellSize::new(0.25).unwrap();
        assert_eq!([cell.index_of(0.0), cell.index_of(0.24), cell.index_of(0.25), cell.index_of(-0.01)], [0, 0, 1, -1]);
        assert_eq!([cell.centre_of(0), cell.centre_of(-1)], [0.125, -0.125]);
    }

    #[test]
    fn negative_cells_lie_in_negative_tiles() {
        let tile = |row, column| Cell { row, column }.tile();
        assert_eq!(tile(0, 31), TileKey { row: 0, column: 0 });
        assert_eq!(tile(-1, 32), TileKey { row: -1, column: 1 });
        assert_eq!(Cell { row: -1, column: 33 }.offset(), 31 * TILE_EDGE + 1);
    }

    #[test]
    fn edges_that_cannot_be_are_refused() {
        for found in [0.0, -0.05, f64::NAN, f64::INFINITY] {
            let error = CellSize::new(found).unwrap_err();
            assert_eq!(error.to_string(), format!("edge of a cell is {found} m, expected a finite number above 0"));
        }
    }

    proptest! {
        #[test]
        fn the_centre_of_a_cell_lies_in_it(index in -100_000_000..100_000_000i32, edge in 0.005..1.0f64) {
            let cell = CellSize::new(edge).unwrap();
            prop_assert_eq!(cell.index_of(cell.centre_of(index)), index);
        }

        #[test]
        fn a_tile_holds_its_cells(row in any::<i32>(), column in any::<i32>()) {
            let cell = Cell { row, column };
            let first = cell.tile().first_cell().unwrap();
            let edge = TILE_EDGE as i32;
            prop_assert!((0..edge).contains(&(row - first.row)) && (0..edge).contains(&(column - first.column)));
        }
    }
}
