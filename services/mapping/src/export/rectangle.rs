//! The part of a layer that is known, as one rectangle of cells.

use messages::{MapTile, TILE_EDGE};

/// Most cells of a rectangle: 400 m × 400 m of 5 cm.
const MAX_CELLS: i64 = 64_000_000;
/// Unknown cells kept around what is known.
const MARGIN: i64 = 8;
/// Edge of a cell of a map that has no tile, m.
const EMPTY_CELL_M: f64 = 0.05;

/// A map that has no place in one picture.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum RectangleError {
    /// Its extent.
    #[error("the map is {columns} × {rows} cells, expected at most {MAX_CELLS} cells")]
    TooLarge {
        /// Columns.
        columns: i64,
        /// Rows.
        rows: i64,
    },
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

/// Rows and columns of cells, ends included.
#[derive(Clone, Copy)]
struct Bounds {
    rows: (i64, i64),
    columns: (i64, i64),
}

impl Rectangle {
    /// The rectangle around all known cells; a map that knows nothing is its margin around the origin.
    pub(super) fn around<'a>(tiles: impl Iterator<Item = &'a MapTile> + Clone) -> Result<Self, RectangleError> {
        let cell_m = tiles.clone().next().map_or(EMPTY_CELL_M, |tile| tile.cell_m);
        if let Some(other) = tiles.clone().find(|tile| tile.cell_m.to_bits() != cell_m.to_bits()) {
            return Err(RectangleError::Mixed { one_m: cell_m, other_m: other.cell_m });
        }
        let known = tiles.clone().flat_map(known_cells).fold(None, |bounds: Option<Bounds>, (row, column, _)| {
            let Bounds { rows, columns } = bounds.unwrap_or(Bounds { rows: (row, row), columns: (column, column) });
            Some(Bounds { rows: (rows.0.min(row), rows.1.max(row)), columns: (columns.0.min(column), columns.1.max(column)) })
        });
        let Bounds { rows, columns } = known.unwrap_or(Bounds { rows: (0, 0), columns: (0, 0) });
        let (first_row, first_column) = (rows.0 - MARGIN, columns.0 - MARGIN);
        let (row_count, column_count) = (rows.1 + MARGIN + 1 - first_row, columns.1 + MARGIN + 1 - first_column);
        if row_count * column_count > MAX_CELLS {
            return Err(RectangleError::TooLarge { columns: column_count, rows: row_count });
        }
        let mut rectangle = Self {
            cell_m,
            origin_m: [first_column as f64 * cell_m, first_row as f64 * cell_m],
            columns: column_count as usize,
            rows: row_count as usize,
            cells: vec![0.0; (row_count * column_count) as usize],
        };
        for (row, column, log_odds) in tiles.flat_map(known_cells) {
            rectangle.cells[((row - first_row) * column_count + column - first_column) as usize] = log_odds;
        }
        Ok(rectangle)
    }

    /// Rows from the largest y down, as pictures have them.
    pub(super) fn rows_from_top(&self) -> impl Iterator<Item = &[f32]> {
        self.cells.chunks_exact(self.columns).rev()
    }
}

fn known_cells(tile: &MapTile) -> impl Iterator<Item = (i64, i64, f32)> {
    let edge = TILE_EDGE as i64;
    let (row, column) = (i64::from(tile.row) * edge, i64::from(tile.column) * edge);
    let cells = tile.log_odds.iter().enumerate().filter(|(_, cell)| **cell != 0.0);
    cells.map(move |(index, cell)| (row + index as i64 / edge, column + index as i64 % edge, *cell))
}

#[cfg(test)]
pub(super) mod tests {
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
    fn a_map_of_the_largest_size_is_drawn_and_no_larger_one() {
        let corner = tile(0, 0, &[(0, 0, 1.0)]);
        // 7984 cells and a margin of 8 on each side are 8000.
        let largest = [corner, tile(249, 249, &[(15, 15, -1.0)])];
        let rectangle = Rectangle::around(largest.iter()).unwrap();
        assert_eq!((rectangle.columns * rectangle.rows) as i64, MAX_CELLS);
        assert_eq!((rectangle.cells[8 * 8000 + 8], rectangle.cells[7991 * 8000 + 7991]), (1.0, -1.0));
        let larger = [corner, tile(249, 249, &[(15, 16, -1.0)])];
        assert_eq!(Rectangle::around(larger.iter()), Err(RectangleError::TooLarge { columns: 8001, rows: 8000 }));
    }

    #[test]
    fn what_fits_no_picture_is_refused() {
        let far = [tile(0, 0, &[(0, 0, 1.0)]), tile(9_000_000, 9_000_000, &[(0, 0, 1.0)])];
        let columns = 9_000_000 * 32 + 17;
        assert_eq!(Rectangle::around(far.iter()), Err(RectangleError::TooLarge { columns, rows: columns }));
        let mixed = [tile(0, 0, &[]), MapTile { cell_m: 0.05, ..tile(0, 1, &[]) }];
        assert_eq!(Rectangle::around(mixed.iter()), Err(RectangleError::Mixed { one_m: 0.1, other_m: 0.05 }));
    }
}
