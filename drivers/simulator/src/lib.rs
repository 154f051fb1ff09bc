//! A simulated world with walkers, and the robot in it.
#![cfg_attr(test, allow(clippy::unwrap_used, clippy::panic, clippy::float_cmp, reason = "tests fail by panicking"))]

mod body;
mod chance;
mod geometry;
mod journey;
mod odometry;
pub mod quantity;
mod simulation;
mod sonar;
mod still;
mod walker;
mod wall;
pub mod world;

pub use body::Body;
pub use simulation::{PACKET_INTERVAL_NS, PING_INTERVAL_NS, Packet, Reading, Simulation};
pub use world::World;
