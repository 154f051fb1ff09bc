//! `map/tile`, `map/way` and `map/summary`: the map as mapping publishes it.

use crate::Invalid;
use crate::layout::plain;
use crate::numbered::numbered;
use crate::service::{at_most, within};

/// Cells along one edge of a tile.
///
/// ```
/// use stillmap_messages::{TILE_CELLS, TILE_EDGE};
///
/// assert_eq!(TILE_EDGE * TILE_EDGE, TILE_CELLS);
/// ```
pub const TILE_EDGE: usize = 32;
/// Cells of a tile.
///
/// ```
/// use stillmap_messages::{MapTile, TILE_CELLS};
///
/// assert_eq!(MapTile::default().log_odds.len(), TILE_CELLS);
/// ```
pub const TILE_CELLS: usize = TILE_EDGE * TILE_EDGE;
/// Most positions in one piece of the trajectory.
///
/// ```
/// use stillmap_messages::{MAX_WAY_POINTS, WayChunk};
///
/// assert_eq!(WayChunk::default().points_m.len(), MAX_WAY_POINTS);
/// ```
pub const MAX_WAY_POINTS: usize = 256;

numbered! {
    /// Which of the two lattices a tile belongs to.
    ///
    /// ```
    /// use stillmap_messages::{Layer, MapTile};
    ///
    /// assert_eq!(Layer::from_number(MapTile::default().layer), Some(Layer::Filtered));
    /// ```
    #[derive(Hash, PartialOrd, Ord)]
    pub enum Layer {
        /// The map without what moves.
        Filtered = 0,
        /// The map of every reading (the paper's Fig. 10 a).
        Unfiltered = 1,
    }
}

numbered! {
    /// Which of two trajectories a piece belongs to.
    ///
    /// ```
    /// use stillmap_messages::{Trajectory, WayChunk};
    ///
    /// assert_eq!(Trajectory::from_number(WayChunk::default().trajectory), Some(Trajectory::Robot));
    /// ```
    pub enum Trajectory {
        /// Where the robot was in the map.
        Robot = 0,
        /// Where the wheels counted it, in the odom frame. It is published where localisation runs.
        Odometry = 1,
    }
}

plain! {
    /// A square of 32 × 32 cells of the map.
    ///
    /// ```
    /// use stillmap_messages::{MapTile, Payload, TILE_EDGE};
    ///
    /// let mut tile = MapTile { cell_m: 0.05, column: -1, row: 2, tiles_in_layer: 1, ..MapTile::default() };
    /// // The cell at x = −1.6 m, y = 3.2 m is occupied.
    /// tile.log_odds[0] = 2.0;
    /// assert_eq!(tile.validate(), Ok(()));
    /// let first_x_m = f64::from(tile.column) * TILE_EDGE as f64 * tile.cell_m;
    /// assert!((first_x_m + 1.6).abs() < 1e-9);
    /// ```
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
        /// Number of tiles of that layer when this one was published. A reader that has as many has the whole map.
        pub tiles_in_layer: u32,
        /// Log-odds of occupancy, row by row from the smallest y; 0 is unknown.
        pub log_odds: [f32; TILE_CELLS],
    }

    /// A piece of the robot's trajectory, for display.
    ///
    /// ```
    /// use stillmap_messages::WayChunk;
    ///
    /// let mut chunk = WayChunk { first: 256, total: 257, count: 1, ..WayChunk::default() };
    /// chunk.points_m[0] = [4.5, -1.0];
    /// ```
    pub struct WayChunk {
        /// Index of the first position of this piece.
        pub first: u64,
        /// Positions of the whole trajectory so far.
        pub total: u64,
        /// x and y of each position, m; the first `count` are valid.
        pub points_m: [[f32; 2]; MAX_WAY_POINTS] => count,
        /// Number of positions in this piece.
        pub count: u32,
        /// [`Trajectory`] as a number.
        pub trajectory: u32,
    }

    /// The finished map in numbers, published once the stream of scans has ended and everything is integrated.
    ///
    /// ```
    /// use stillmap_messages::{MapSummary, Payload};
    ///
    /// let summary = MapSummary { scans: 1_112, way_m: 31.5, ..MapSummary::default() };
    /// assert_eq!(summary.validate(), Ok(()));
    /// ```
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
        /// Length of the trajectory, m.
        pub way_m: f64,
    }
}

impl MapTile {
    pub(crate) fn check(&self) -> Result<(), Invalid> {
        within("cell_m", self.cell_m, 0.005, 1.0, "0.005 to 1 m")?;
        at_most("layer", self.layer, 1, "0 or 1")?;
        within("column", f64::from(self.column), -1e7, 1e7, "−10000000 to 10000000")?;
        within("row", f64::from(self.row), -1e7, 1e7, "−10000000 to 10000000")?;
        for value in self.log_odds {
            within("log_odds", f64::from(value), -100.0, 100.0, "−100 to 100")?;
        }
        Ok(())
    }
}

impl WayChunk {
    pub(crate) fn check(&self) -> Result<(), Invalid> {
        at_most("count", self.count, MAX_WAY_POINTS, "at most 256")?;
        at_most("trajectory", self.trajectory, 1, "0 or 1")?;
        for point in &self.points_m[..self.count as usize] {
            within("points_m", f64::from(point[0]), -1e6, 1e6, "at most 1000 km from the origin")?;
            within("points_m", f64::from(point[1]), -1e6, 1e6, "at most 1000 km from the origin")?;
        }
        Ok(())
    }
}

impl MapSummary {
    pub(crate) fn check(&self) -> Result<(), Invalid> {
        within("way_m", self.way_m, 0.0, 1e9, "0 to 1000000000 m")
    }
}
