#![cfg_attr(
    test,
    allow(
        clippy::unwrap_used,
        clippy::panic,
        clippy::float_cmp,
        reason = "tests fail by panicking, on exact values where these are exact"
    )
)]

//! The unbounded tiled lattice that maps are made of.
//!
//! A [`Lattice`] covers the plane of the map frame with square cells. Cell i covers [i · cell, (i + 1) · cell) along its axis
//! and has its centre at (i + ½) · cell. Only tiles of 32 × 32 cells that were written to take memory; a cell never written
//! has the default value of its type. Access takes the same time however large the map is, and tiles are listed in the order
//! of their place, whatever the order in which they were written.

mod angle;
mod beam;
mod frame;
mod lattice;
mod place;
mod recent;
mod tile;

pub use angle::wrapped;
pub use beam::{Beam, InBeam};
pub use frame::{Map, MapFromOdom, MapFromRobot, Odom, OdomFromRobot, Robot, Sonar, Transform};
pub use lattice::Lattice;
pub use place::{Cell, CellSize, CellSizeError, TileKey};
pub use tile::{TILE_CELLS, TILE_EDGE, Tile};
