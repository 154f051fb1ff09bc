//! `map/tile`, `map/way` and `map/summary`: the map as its owner publishes it.

use crate::Invalid;
use crate::layout::plain;
use crate::service::{at_most, within};

/// Cells along one edge of a tile.
pub const TILE_EDGE: usize = 32;
/// Cells of a tile.
pub const TILE_CELLS: usize = TILE_EDGE * TILE_EDGE;
/// Most places in one piece of the robot's way.
pub const MAX_WAY_POINTS: usize = 256;

/// Which of the two lattices a tile belongs to.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
#[repr(u32)]
pub enum Layer {
    /// What moves is taken out.
    Filtered = 0,
    /// Every reading counts (the paper's Fig. 10 a).
    Unfiltered = 1,
}

impl Layer {
    /// The layer a number stands for, if any.
    #[must_use]
    pub fn from_number(number: u32) -> Option<Self> {
        match number {
            0 => Some(Self::Filtered),
            1 => Some(Self::Unfiltered),
            _ => None,
        }
    }
}

plain! {
    /// A square of 32 × 32 cells of the map.
    pub struct MapTile {
        /// Edge of a cell, m.
        pub cell_m: f64,
        /// Last scan whose readings the tile shows.
        pub scan_seq: u64,
        /// Column of the tile: its cells start at x = `column` × 32 × `cell_m` in the map frame.
        pub column: i32,
        /// Row of the tile: its cells start at y = `row` × 32 × `cell_m` in the map frame.
        pub row: i32,
        /// [`Layer`] as a number.
        pub layer: u32,
        /// Tiles of that layer when this one was published: who holds as many holds the whole map.
        pub tiles_in_layer: u32,
        /// Log-odds of occupancy, row by row from the smallest y; 0 is unknown.
        pub log_odds: [f32; TILE_CELLS],
    }

    /// A piece of the robot's way, for pictures.
    pub struct WayChunk {
        /// Number of the first place of this piece.
        pub first: u64,
        /// Places so far, of the whole way.
        pub total: u64,
        /// x and y of each place in the map frame, m; the first `count` are valid.
        pub points_m: [[f32; 2]; MAX_WAY_POINTS] => count,
        /// Number of places in this piece.
        pub count: u32,
        /// Always 0.
        pub reserved: u32,
    }

    /// The finished map in numbers, published once the stream of scans has ended and everything is integrated.
    pub struct MapSummary {
        /// SHA-256 over cells and placement of the filtered layer.
        pub sha256: [u8; 32],
        /// Scans integrated.
        pub scans: u64,
        /// Readings integrated.
        pub readings: u64,
        /// Readings whose occupied part was withheld.
        pub withheld: u64,
        /// Readings integrated without a verdict, where verdicts were expected.
        pub undecided: u64,
        /// Tiles of the filtered layer.
        pub tiles: u64,
        /// Length of the robot's way, m.
        pub way_m: f64,
    }
}

impl MapTile {
    pub(crate) fn check(&self) -> Result<(), Invalid> {
        within("cell_m", self.cell_m, 0.005, 1.0, "0.005 to 1 m")?;
        at_most("layer", self.layer, 1, "0 or 1")?;
        within("column", f64::from(self.column), -1e7, 1e7, "a tile within reach")?;
        within("row", f64::from(self.row), -1e7, 1e7, "a tile within reach")?;
        for value in self.log_odds {
            within("log_odds", f64::from(value), -100.0, 100.0, "−100 to 100")?;
        }
        Ok(())
    }
}

impl WayChunk {
    pub(crate) fn check(&self) -> Result<(), Invalid> {
        at_most("count", self.count, MAX_WAY_POINTS, "at most 256")?;
        for point in &self.points_m[..self.count as usize] {
            within("points_m", f64::from(point[0]), -1e6, 1e6, "at most 1000 km from the origin")?;
            within("points_m", f64::from(point[1]), -1e6, 1e6, "at most 1000 km from the origin")?;
        }
        Ok(())
    }
}

impl MapSummary {
    pub(crate) fn check(&self) -> Result<(), Invalid> {
        within("way_m", self.way_m, 0.0, 1e9, "a length")
    }
}
