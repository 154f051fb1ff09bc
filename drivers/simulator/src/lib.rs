//! A simulated world with walkers, and the robot in it, which a client meets at a serial port.
//!
//! | part | is |
//! | --- | --- |
//! | [`World`] | what stands and walks, and the robot's way, as a file has it |
//! | [`Simulation`] | the drive: a packet every 100 ms of what the robot knows, with the truth behind it |
//! | [`camera::Camera`] | what the robot's camera sees of it, and the truth of each pixel |
//! | [`RobotEnd`] | the robot's end of the serial protocol: bytes in, bytes out |
//!
//! All but the terminal is pure. The drive is a function of world, robot and seed: where anything is, is a function of time, and
//! each ping has random numbers of its own. So a drive is the same however often it is stopped and taken up, and the same walls
//! sound the same for any walker.
//!
//! Terms: the *world's frame* is that of the file; odometry is told in the frame of the robot's start, the map's origin.
//! Sound is flat: everything stands as high as the sonars.
#![cfg_attr(test, allow(clippy::unwrap_used, clippy::panic, clippy::float_cmp, reason = "tests fail by panicking"))]

mod body;
pub mod camera;
mod chance;
mod check;
mod config_packet;
mod geometry;
mod journey;
mod odometry;
mod optics;
pub mod quantity;
mod robot_end;
mod simulation;
mod sonar;
mod still;
mod timetable;
mod walker;
mod wall;
pub mod world;

pub use body::Body;
pub use check::WorldFault;
pub use journey::STANDSTILL_NS;
pub use optics::{CalibrationError, Optics};
pub use robot_end::RobotEnd;
pub use simulation::{PACKET_INTERVAL_NS, PING_INTERVAL_NS, Packet, Reading, Simulation};
pub use timetable::Timetable;
pub use world::World;
