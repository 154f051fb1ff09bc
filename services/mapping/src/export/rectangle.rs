//! The part of a layer that is known, as one rectangle of cells.

use messages::MapTile;

use super::extent::{Extent, known_cells};

/// Edge of a cell of a map that has no tile, m.
const EMPTY_CELL_M: f64 = 0.05;

/// A map that has no place in one picture.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum RectangleError {
    /// Tiles of two maps.
    #[error("tiles with cells of {one_m} m and of {other_m} m, expected one size")]
    Mixed {
        /// Edge of a cell in one tile.
        one_m: f64,
        /// Edge of a cell in another.
        other_m: f64,
    },
}

/// Log-odds of a rectangle of cells, row by row from the smallest y.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Rectangle {
    pub(super) cell_m: f64,
    /// Lower left corner in the map frame, m.
    pub(super) origin_m: [f64; 2],
    pub(super) columns: usize,
    pub(super) rows: usize,
    cells: Vec<f32>,
}

impl Rectangle {
    /// The cells of the tiles that lie in an extent.
    pub(super) fn of<'a>(extent: &Extent, tiles: impl Iterator<Item = &'a MapTile> + Clone) -> Result<Self, RectangleError> {
        let cell_m = tiles.clone().next().map_or(EMPTY_CELL_M, |tile| tile.cell_m);
        if let Some(other) = tiles.clone().find(|tile| tile.cell_m.to_bits() != cell_m.to_bits()) {
            return Err(RectangleError::Mixed { one_m: cell_m, other_m: other.cell_m });
        }
        let (first_row, first_column, columns) = (*extent.rows.start(), *extent.columns.start(), extent.column_count());
        let mut rectangle = Self {
            cell_m,
            origin_m: [first_column as f64 * cell_m, first_row as f64 * cell_m],
            columns: columns as usize,
            rows: extent.row_count() as usize,
            cells: vec![0.0; extent.cells() as usize],
        };
        for (row, column, log_odds) in tiles.flat_map(known_cells).filter(|(row, column, _)| extent.contains(*row, *column)) {
            rectangle.cells[((row - first_row) * columns + column - first_column) as usize] = log_odds;
        }
        Ok(rectangle)
    }

    /// The rectangle around all known cells.
    #[cfg(test)]
    pub(super) fn around<'a>(tiles: impl Iterator<Item = &'a MapTile> + Clone) -> Result<Self, RectangleError> {
        Self::of(&Extent::of(tiles.clone()), tiles)
    }

    /// Rows from the largest y down, as pictures have them.
    pub(super) fn rows_from_top(&self) -> impl Iterator<Item = &[f32]> {
        self.cells.chunks_exact(self.columns).rev()
    }
}

#[cfg(test)]
pub(super) mod tests {
    use messages::TILE_EDGE;

    use super::*;

    /// A tile in which the given cells (row, column) are known.
    pub(crate) fn tile(row: i32, column: i32, cells: &[(usize, usize, f32)]) -> MapTile {
        let mut tile = MapTile { cell_m: 0.1, row, column, tiles_in_layer: 1, ..MapTile::default() };
        cells.iter().for_each(|&(r, c, log_odds)| tile.log_odds[r * TILE_EDGE + c] = log_odds);
        tile
    }

    #[test]
    fn it_holds_what_is_known_and_a_margin() {
        let tiles = [tile(0, -1, &[(2, 31, 1.5)]), tile(0, 0, &[(4, 0, -1.5)])];
        let rectangle = Rectangle::around(tiles.iter()).unwrap();
        assert_eq!((rectangle.columns, rectangle.rows), (2 + 16, 3 + 16));
        assert!((rectangle.origin_m[0] + 0.9).abs() < 1e-12 && (rectangle.origin_m[1] + 0.6).abs() < 1e-12);
        let rows: Vec<&[f32]> = rectangle.rows_from_top().collect();
        assert_eq!((rows[8][9], rows[10][8]), (-1.5, 1.5));
        assert_eq!(rows.concat().iter().filter(|cell| **cell != 0.0).count(), 2);
    }

    #[test]
    fn an_empty_map_is_a_small_unknown_square() {
        let rectangle = Rectangle::around([].iter()).unwrap();
        assert_eq!((rectangle.columns, rectangle.rows, rectangle.cells.len()), (17, 17, 289));
    }

    #[test]
    fn cells_outside_the_extent_are_left_out() {
        let tiles = [tile(0, 0, &[(0, 0, 1.0), (5, 7, -1.0)]), tile(3, 3, &[(0, 0, 1.0)])];
        let extent = Extent { rows: -1..=6, columns: 0..=9 };
        let rectangle = Rectangle::of(&extent, tiles.iter()).unwrap();
        assert_eq!((rectangle.columns, rectangle.rows), (10, 8));
        assert_eq!((rectangle.cells[10], rectangle.cells[6 * 10 + 7]), (1.0, -1.0));
        assert_eq!(rectangle.cells.iter().filter(|cell| **cell != 0.0).count(), 2);
    }

    #[test]
    fn tiles_of_two_cell_sizes_are_refused() {
        let mixed = [tile(0, 0, &[]), MapTile { cell_m: 0.05, ..tile(0, 1, &[]) }];
        assert_eq!(Rectangle::around(mixed.iter()), Err(RectangleError::Mixed { one_m: 0.1, other_m: 0.05 }));
    }
}
