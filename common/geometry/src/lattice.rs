//! The lattice itself.

use std::collections::HashMap;
use std::hash::{BuildHasherDefault, Hasher};
use std::ops::Range;

use crate::place::within_tile;
use crate::recent::Recent;
use crate::tile::{TILE_CELLS, TILE_EDGE, Tile};
use crate::{Cell, CellSize, TileKey};

/// An unbounded lattice of cells; what was never written holds `T::default()`.
#[derive(Debug, Clone)]
pub struct Lattice<T> {
    cell: CellSize,
    /// Where in `tiles` each tile is.
    slots: HashMap<TileKey, usize, BuildHasherDefault<KeyHasher>>,
    tiles: Vec<Stored<T>>,
    recent: Recent,
    /// Slots of the tiles that were written to since they were last asked for.
    changed: Vec<usize>,
}

#[derive(Debug, Clone)]
struct Stored<T> {
    key: TileKey,
    changed: bool,
    cells: Tile<T>,
}

impl<T: Copy + Default> Lattice<T> {
    /// An empty lattice.
    #[must_use]
    pub fn new(cell: CellSize) -> Self {
        Self { cell, slots: HashMap::default(), tiles: Vec::new(), recent: Recent::default(), changed: Vec::new() }
    }

    /// Edge of a cell.
    #[must_use]
    pub fn cell_size(&self) -> CellSize {
        self.cell
    }

    /// The value of a cell.
    #[must_use]
    pub fn get(&self, cell: Cell) -> T {
        self.find(cell.tile()).map_or_else(T::default, |slot| self.tiles[slot].cells[cell.offset()])
    }

    /// Gives a cell a value.
    pub fn set(&mut self, cell: Cell, value: T) {
        let slot = self.slot_to_write(cell.tile());
        self.tiles[slot].cells[cell.offset()] = value;
    }

    /// Shows the cells of a row in the given columns, piece by piece: `visit` is given the column of its first cell and the
    /// cells of one tile. Tiles never written to are left out: they hold the default value.
    pub fn visit_row(&self, row: i32, columns: Range<i32>, mut visit: impl FnMut(i32, &[T])) {
        for piece in pieces(row, columns) {
            if let Some(slot) = self.find(piece.tile) {
                visit(piece.column, &self.tiles[slot].cells[piece.cells]);
            }
        }
    }

    /// As [`Self::visit_row`], to be written to: tiles that are missing are made.
    pub fn visit_row_mut(&mut self, row: i32, columns: Range<i32>, mut visit: impl FnMut(i32, &mut [T])) {
        for piece in pieces(row, columns) {
            let slot = self.slot_to_write(piece.tile);
            visit(piece.column, &mut self.tiles[slot].cells[piece.cells]);
        }
    }

    /// The cells of a tile, if it was ever written to.
    #[must_use]
    pub fn tile(&self, key: TileKey) -> Option<&Tile<T>> {
        self.find(key).map(|slot| &self.tiles[slot].cells)
    }

    /// Replaces all cells of a tile.
    pub fn set_tile(&mut self, key: TileKey, cells: &Tile<T>) {
        let slot = self.slot_to_write(key);
        self.tiles[slot].cells = *cells;
    }

    /// All tiles, in the order of their place. Takes time n log n in their number.
    pub fn tiles(&self) -> impl Iterator<Item = (TileKey, &Tile<T>)> {
        let mut order: Vec<&Stored<T>> = self.tiles.iter().collect();
        order.sort_unstable_by_key(|tile| tile.key);
        order.into_iter().map(|tile| (tile.key, &tile.cells))
    }

    /// Number of tiles.
    #[must_use]
    pub fn tile_count(&self) -> usize {
        self.tiles.len()
    }

    /// The tiles written to since this was last asked, in the order of their place. Takes time in their number alone.
    pub fn take_changed(&mut self) -> Vec<TileKey> {
        let mut keys = Vec::with_capacity(self.changed.len());
        for slot in self.changed.drain(..) {
            let tile = &mut self.tiles[slot];
            tile.changed = false;
            keys.push(tile.key);
        }
        keys.sort_unstable();
        keys
    }

    fn find(&self, key: TileKey) -> Option<usize> {
        self.recent.get(key).or_else(|| self.slots.get(&key).copied())
    }

    fn slot_to_write(&mut self, key: TileKey) -> usize {
        let slot = match self.recent.get(key) {
            Some(slot) => slot,
            None => self.slot_of(key),
        };
        let tile = &mut self.tiles[slot];
        if !tile.changed {
            tile.changed = true;
            self.changed.push(slot);
        }
        slot
    }

    fn slot_of(&mut self, key: TileKey) -> usize {
        let slot = *self.slots.entry(key).or_insert_with(|| {
            self.tiles.push(Stored { key, changed: false, cells: [T::default(); TILE_CELLS] });
            self.tiles.len() - 1
        });
        self.recent.put(key, slot);
        slot
    }
}

/// Cells of one row within one tile.
struct Piece {
    tile: TileKey,
    /// Column of the first cell.
    column: i32,
    /// Where the cells are within the tile.
    cells: Range<usize>,
}

fn pieces(row: i32, columns: Range<i32>) -> impl Iterator<Item = Piece> {
    let row_start = within_tile(row) * TILE_EDGE;
    let mut column = columns.start;
    std::iter::from_fn(move || {
        if column >= columns.end {
            return None;
        }
        let first = column;
        let start = within_tile(first);
        // The remaining columns may be more than an i32 counts.
        let count = (i64::from(columns.end) - i64::from(first)).min((TILE_EDGE - start) as i64);
        column = first.saturating_add(count as i32);
        let cells = row_start + start..row_start + start + count as usize;
        Some(Piece { tile: Cell { row, column: first }.tile(), column: first, cells })
    })
}

/// Mixes the eight bytes of a [`TileKey`]; the standard hasher takes longer than all else of a look-up. It is the same in every run.
#[derive(Default)]
struct KeyHasher(u64);

impl Hasher for KeyHasher {
    fn finish(&self) -> u64 {
        self.0
    }

    fn write(&mut self, bytes: &[u8]) {
        for &byte in bytes {
            self.mix(u64::from(byte));
        }
    }

    fn write_i32(&mut self, number: i32) {
        self.mix(u64::from(number as u32));
    }
}

impl KeyHasher {
    fn mix(&mut self, number: u64) {
        // 2⁶⁴ divided by the golden ratio; the rotation brings the well mixed high bits down to where the table looks.
        self.0 = (self.0 ^ number).wrapping_mul(0x9e37_79b9_7f4a_7c15).rotate_left(29);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::collections::BTreeMap;

    fn lattice() -> Lattice<u32> {
        Lattice::new(CellSize::new(0.05).unwrap())
    }

    fn place() -> impl Strategy<Value = Cell> {
        let index = prop_oneof![-70..70i32, any::<i32>()];
        (index.clone(), index).prop_map(|(row, column)| Cell { row, column })
    }

    #[test]
    fn a_cell_never_written_is_default_and_takes_no_memory() {
        let lattice = lattice();
        assert_eq!(lattice.get(Cell { row: i32::MAX, column: i32::MIN }), 0);
        assert_eq!(lattice.tile_count(), 0);
    }

    #[test]
    fn tiles_are_listed_by_place_whatever_the_order_of_writing() {
        let keys = |order: &[(i32, i32)]| {
            let mut lattice = lattice();
            order.iter().for_each(|&(row, column)| lattice.set(Cell { row, column }, 1));
            let listed: Vec<TileKey> = lattice.tiles().map(|(key, _)| key).collect();
            assert_eq!(lattice.take_changed(), listed);
            listed
        };
        let places = [(500, 3), (-1, 40), (0, 0), (500, -90)];
        let reversed: Vec<_> = places.iter().rev().copied().collect();
        assert_eq!(keys(&places), keys(&reversed));
        assert!(keys(&places).is_sorted());
    }

    #[test]
    fn a_changed_tile_is_told_once() {
        let mut lattice = lattice();
        lattice.set(Cell { row: 0, column: 0 }, 1);
        lattice.set(Cell { row: 1, column: 1 }, 2);
        assert_eq!(lattice.take_changed(), [TileKey { row: 0, column: 0 }]);
        assert_eq!(lattice.take_changed(), []);
        lattice.set(Cell { row: 0, column: -1 }, 3);
        assert_eq!(lattice.take_changed(), [TileKey { row: 0, column: -1 }]);
    }

    #[test]
    fn a_row_is_shown_tile_by_tile_and_missing_tiles_are_left_out() {
        let mut lattice = lattice();
        lattice.set(Cell { row: 5, column: -3 }, 7);
        lattice.set(Cell { row: 5, column: 70 }, 8);
        let mut seen = Vec::new();
        lattice.visit_row(5, -4..72, |column, cells| seen.push((column, cells.to_vec())));
        assert_eq!(seen, [(-4, vec![0, 7, 0, 0]), (64, vec![0, 0, 0, 0, 0, 0, 8, 0])]);
        assert_eq!(lattice.tile_count(), 2);
    }

    #[test]
    fn a_row_up_to_the_last_column_ends() {
        let mut seen = 0;
        lattice().visit_row_mut(i32::MIN, i32::MAX - 40..i32::MAX, |_, cells| seen += cells.len());
        assert_eq!(seen, 40);
    }

    proptest! {
        #[test]
        fn it_holds_what_was_written(writes in proptest::collection::vec((place(), any::<u32>()), 0..200), looks in proptest::collection::vec(place(), 50)) {
            let mut lattice = lattice();
            let mut expected = BTreeMap::new();
            for (cell, value) in writes {
                lattice.set(cell, value);
                expected.insert(cell, value);
                prop_assert_eq!(lattice.get(cell), value);
            }
            for cell in looks.iter().chain(expected.keys()) {
                prop_assert_eq!(lattice.get(*cell), expected.get(cell).copied().unwrap_or_default());
            }
            let tiles: std::collections::BTreeSet<TileKey> = expected.keys().map(|c| c.tile()).collect();
            prop_assert_eq!(lattice.tiles().map(|(key, _)| key).collect::<Vec<_>>(), tiles.into_iter().collect::<Vec<_>>());
        }

        #[test]
        fn rows_written_are_rows_read(row in -40..40i32, start in -100..100i32, length in 0..150i32) {
            let mut lattice = lattice();
            lattice.visit_row_mut(row, start..start + length, |first, cells| {
                cells.iter_mut().zip(first..).for_each(|(cell, column)| *cell = column.unsigned_abs() + 1);
            });
            for column in start - 2..start + length + 2 {
                let expected = if (start..start + length).contains(&column) { column.unsigned_abs() + 1 } else { 0 };
                prop_assert_eq!(lattice.get(Cell { row, column }), expected);
            }
            let mut columns = Vec::new();
            lattice.visit_row(row, start..start + length, |first, cells| columns.extend((first..).take(cells.len())));
            prop_assert_eq!(columns, (start..start + length).collect::<Vec<_>>());
        }
    }
}
