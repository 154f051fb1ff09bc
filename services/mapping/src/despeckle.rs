//! Occupied cells without neighbours (the end of the paper's Table 6).

use geometry::{Cell, Lattice, TILE_CELLS, TILE_EDGE, Tile, TileKey};

use crate::occupied::is_occupied;

/// A tile as it is published: an occupied cell with fewer than `lonely_below` occupied ones among its eight neighbours is
/// given the value of its opposite, free.
pub(crate) fn published(shown: &Lattice<f32>, key: TileKey, lonely_below: usize) -> Tile<f32> {
    let Some(tile) = shown.tile(key) else { return [0.0; TILE_CELLS] };
    let mut cells = *tile;
    let Some(first) = key.first_cell().filter(|_| lonely_below > 0) else { return cells };
    for (index, value) in cells.iter_mut().enumerate().filter(|(_, value)| is_occupied(**value)) {
        let (row, column) = (first.row + (index / TILE_EDGE) as i32, first.column + (index % TILE_EDGE) as i32);
        if occupied_neighbours(shown, row, column) < lonely_below {
            *value = -*value;
        }
    }
    cells
}

fn occupied_neighbours(shown: &Lattice<f32>, row: i32, column: i32) -> usize {
    let around = (-1..=1).flat_map(|up| (-1..=1).map(move |right| (up, right))).filter(|place| *place != (0, 0));
    let at = |(up, right): &(i32, i32)| Cell { row: row.saturating_add(*up), column: column.saturating_add(*right) };
    around.filter(|place| is_occupied(shown.get(at(place)))).count()
}

/// The tiles whose published cells may change with a tile: itself, and its neighbours where they look across their edge.
pub(crate) fn tiles_that_see(key: TileKey, lonely_below: usize) -> impl Iterator<Item = TileKey> {
    let reach = i32::from(lonely_below > 0);
    (-reach..=reach).flat_map(move |up| {
        (-reach..=reach).map(move |right| TileKey { row: key.row.saturating_add(up), column: key.column.saturating_add(right) })
    })
}
