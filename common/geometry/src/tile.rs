//! A square of cells.

/// log₂ of [`TILE_EDGE`].
pub(crate) const TILE_EDGE_LOG2: u32 = 5;
/// Cells along one edge of a tile.
pub const TILE_EDGE: usize = 1 << TILE_EDGE_LOG2;
/// Cells of a tile.
pub const TILE_CELLS: usize = TILE_EDGE * TILE_EDGE;

/// The cells of a tile, row by row from the smallest y.
pub type Tile<T> = [T; TILE_CELLS];
