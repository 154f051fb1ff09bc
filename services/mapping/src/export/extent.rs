//! The rows and columns of cells that become a picture.

use std::collections::BTreeMap;
use std::ops::RangeInclusive;

use messages::{MapTile, TILE_EDGE};

/// Most cells of a picture: 400 m × 400 m of 5 cm.
pub(super) const MAX_CELLS: i64 = 64_000_000;
/// Unknown cells around the known ones.
const MARGIN: i64 = 8;
const EDGE: i64 = TILE_EDGE as i64;

/// A rectangle of the map's cells.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Extent {
    pub(super) rows: RangeInclusive<i64>,
    pub(super) columns: RangeInclusive<i64>,
}

impl Extent {
    /// The known cells with a margin; without any, the margin around the origin.
    pub(super) fn of<'a>(tiles: impl Iterator<Item = &'a MapTile>) -> Self {
        let known = tiles.flat_map(known_cells).fold(None, |bounds: Option<[i64; 4]>, (row, column, _)| {
            let [first_row, last_row, first_column, last_column] = bounds.unwrap_or([row, row, column, column]);
            Some([first_row.min(row), last_row.max(row), first_column.min(column), last_column.max(column)])
        });
        let [first_row, last_row, first_column, last_column] = known.unwrap_or_default();
        Self { rows: first_row - MARGIN..=last_row + MARGIN, columns: first_column - MARGIN..=last_column + MARGIN }
    }

    /// The known cells if they fit a picture, otherwise a part of them that does.
    ///
    /// A wrong pose puts a small part of the map far away from the rest. So the map is cut where it is empty over the greatest
    /// length, and the side with fewer known cells is dropped, until the rest fits. A map without gaps loses the outer tiles that
    /// know least.
    pub(super) fn fitting<'a>(tiles: impl Iterator<Item = &'a MapTile>) -> Self {
        let mut tiles: Vec<&MapTile> = tiles.filter(|tile| known_cells(tile).next().is_some()).collect();
        loop {
            let extent = Self::of(tiles.iter().copied());
            if extent.fits() {
                return extent;
            }
            // Only one tile could be left that cannot be cut, and it fits.
            let Some(cut) = Cut::best(&tiles) else { return extent };
            tiles.retain(|tile| !cut.drops(tile));
        }
    }

    pub(super) fn row_count(&self) -> i64 {
        self.rows.end() - self.rows.start() + 1
    }

    pub(super) fn column_count(&self) -> i64 {
        self.columns.end() - self.columns.start() + 1
    }

    pub(super) fn cells(&self) -> i64 {
        self.row_count().saturating_mul(self.column_count())
    }

    /// Whether a picture holds it.
    pub(super) fn fits(&self) -> bool {
        self.cells() <= MAX_CELLS
    }

    pub(super) fn contains(&self, row: i64, column: i64) -> bool {
        self.rows.contains(&row) && self.columns.contains(&column)
    }
}

/// The known cells of a tile by row, column and log-odds.
pub(super) fn known_cells(tile: &MapTile) -> impl Iterator<Item = (i64, i64, f32)> {
    let (row, column) = (i64::from(tile.row) * EDGE, i64::from(tile.column) * EDGE);
    let cells = tile.log_odds.iter().enumerate().filter(|(_, cell)| **cell != 0.0);
    cells.map(move |(index, cell)| (row + index as i64 / EDGE, column + index as i64 % EDGE, *cell))
}

#[derive(Clone, Copy)]
enum Axis {
    Rows,
    Columns,
}

impl Axis {
    fn of(self, tile: &MapTile) -> i64 {
        i64::from(match self {
            Self::Rows => tile.row,
            Self::Columns => tile.column,
        })
    }
}

/// A line between tiles, and the side that is dropped.
struct Cut {
    axis: Axis,
    /// The side from the first of these rows or columns to the last is dropped.
    dropped: RangeInclusive<i64>,
    /// Empty rows or columns of tiles at the line.
    gap: i64,
    /// Known cells on the dropped side.
    lost: usize,
}

impl Cut {
    /// The cut at the longest gap, and among equal ones the cut that loses least; `None` for tiles in one row and column.
    fn best(tiles: &[&MapTile]) -> Option<Self> {
        let counts: Vec<usize> = tiles.iter().map(|tile| known_cells(tile).count()).collect();
        let total: usize = counts.iter().sum();
        let cuts = [Axis::Rows, Axis::Columns].into_iter().flat_map(|axis| {
            let mut lines = BTreeMap::<i64, usize>::new();
            for (tile, count) in tiles.iter().zip(&counts) {
                *lines.entry(axis.of(tile)).or_default() += count;
            }
            let lines: Vec<(i64, usize)> = lines.into_iter().collect();
            let mut below = 0;
            let mut cuts = Vec::new();
            for pair in lines.windows(2) {
                let [(line, count), (next, _)] = [pair[0], pair[1]];
                below += count;
                let (dropped, lost) = if below <= total - below { (i64::MIN..=line, below) } else { (next..=i64::MAX, total - below) };
                cuts.push(Self { axis, dropped, gap: next - line - 1, lost });
            }
            cuts
        });
        cuts.reduce(|best, cut| if (cut.gap, best.lost) > (best.gap, cut.lost) { cut } else { best })
    }

    fn drops(&self, tile: &MapTile) -> bool {
        self.dropped.contains(&self.axis.of(tile))
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::super::rectangle::tests::tile;
    use super::*;

    #[test]
    fn a_map_of_the_largest_size_is_not_cut() {
        let corner = tile(0, 0, &[(0, 0, 1.0)]);
        // 7984 cells and a margin of 8 on each side are 8000.
        let largest = [corner, tile(249, 249, &[(15, 15, -1.0)])];
        let extent = Extent::fitting(largest.iter());
        assert_eq!((extent.clone(), extent.cells()), (Extent { rows: -8..=7991, columns: -8..=7991 }, MAX_CELLS));
        let larger = [corner, tile(249, 249, &[(15, 15, -1.0), (15, 16, -1.0)])];
        let most = Extent { rows: 7991 - 16..=7991, columns: 7991 - 16..=7991 + 1 };
        assert_eq!(Extent::fitting(larger.iter()), most, "the side with fewer known cells is dropped");
    }

    #[test]
    fn the_smaller_of_two_parts_far_apart_is_dropped() {
        for far in [200, 9_000_000, i32::MAX, i32::MIN] {
            let near = [tile(0, 0, &[(0, 0, 1.0), (9, 9, 1.0)]), tile(3, 2, &[(0, 0, 1.0)])];
            let tiles: Vec<MapTile> = near.into_iter().chain([tile(far, far, &[(0, 0, 1.0), (31, 31, 1.0)])]).collect();
            let expected = if far == 200 { Extent::of(tiles.iter()) } else { Extent::of(near.iter()) };
            assert_eq!(Extent::fitting(tiles.iter()), expected, "{far}");
        }
    }

    #[test]
    fn a_map_without_gaps_loses_the_outer_tiles_that_know_least() {
        // A frame of 260 × 260 tiles, 8320 cells wide. The last column knows most.
        let frame = (0..260).flat_map(|at| [(0, at), (259, at), (at, 0), (at, 259)]);
        let tiles: Vec<MapTile> = frame.map(|(row, column)| tile(row, column, if column == 259 { &FULL } else { &SPARSE })).collect();
        let extent = Extent::fitting(tiles.iter());
        assert!(extent.fits() && extent.contains(130 * 32, 259 * 32), "{extent:?}");
        assert!(extent.cells() > MAX_CELLS * 9 / 10, "{extent:?}");
    }

    const FULL: [(usize, usize, f32); 3] = [(0, 0, 1.0), (1, 0, 1.0), (31, 31, 1.0)];
    const SPARSE: [(usize, usize, f32); 2] = [(0, 0, 1.0), (31, 31, 1.0)];

    proptest! {
        #[test]
        fn the_extent_of_any_tiles_fits_and_knows_something(
            places in prop::collection::vec((any::<i32>(), any::<i32>(), 0_usize..32, 0_usize..32), 1..12),
        ) {
            let tiles: Vec<MapTile> = places.iter().map(|&(row, column, r, c)| tile(row, column, &[(r, c, 1.0)])).collect();
            let extent = Extent::fitting(tiles.iter());
            prop_assert!(extent.fits());
            prop_assert!(tiles.iter().flat_map(known_cells).any(|(row, column, _)| extent.contains(row, column)));
        }
    }
}
