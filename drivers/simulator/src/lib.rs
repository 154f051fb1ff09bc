//! A simulated world with walkers, and the robot in it.
#![cfg_attr(test, allow(clippy::unwrap_used, clippy::panic, clippy::float_cmp, reason = "tests fail by panicking"))]

mod body;
mod chance;
mod config_packet;
mod drive_state;
mod geometry;
mod journey;
mod odometry;
mod process;
pub mod quantity;
mod robot_end;
mod simulation;
mod sonar;
mod still;
mod terminal;
mod walker;
mod wall;
pub mod world;

pub use body::Body;
pub use process::{PORT_NAME, SimulatorError, read_world, run};
pub use robot_end::RobotEnd;
pub use simulation::{PACKET_INTERVAL_NS, PING_INTERVAL_NS, Packet, Reading, Simulation};
pub use world::World;
