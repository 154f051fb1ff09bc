//! Driver of a Pioneer's serial sonar and odometry (PSOS and P2OS protocol).
//!
//! The core opens no port and reads no clock: a [`Session`] takes bytes and times and returns commands and scans.
//!
//! | part | does |
//! | --- | --- |
//! | [`Session`] | finds the robot, keeps the link alive, notices what is wrong with it |
//! | [`Command`] | what can be said to a robot: nothing that moves it |
//! | [`Scanner`] | status packet to scan, with the plausibility of what a checksum lets through |
//! | [`Odometry`] | counters that wrap around to a pose that never jumps |
//! | [`Condition`] | what is wrong with the robot or its line, while it lasts |
//! | [`Arrivals`] | stamps by the arrival of a packet's first byte |
//! | [`recording`] | decodes recorded bytes |
//! | [`Port`] | a serial line or a connection that never blocks |
//! | [`Share`] | ports on which another program uses the robot |
//! | [`probe()`] | asks who is on a port |
//!
//! *Gap*: something was lost before a scan: packets, the link, or odometry that was refused. The scan says so. *Doubt*: a gap in which
//! the robot may have moved without the counters telling where to.
#![cfg_attr(test, allow(clippy::unwrap_used, clippy::panic, clippy::float_cmp, reason = "tests fail by panicking"))]

mod address;
mod arrivals;
mod checkpoint;
mod command;
mod condition;
mod conditions;
mod connect;
mod duplicates;
mod event;
mod exchange;
mod loss;
mod odometry;
mod parameters;
mod port;
mod probe;
mod readings;
pub mod recording;
mod scanner;
mod session;
mod share;
mod sonar_watch;

pub use address::Address;
pub use arrivals::{Arrivals, Rhythm};
pub use checkpoint::Checkpoint;
pub use command::Command;
pub use condition::Condition;
pub use connect::{OpenError, Opening};
pub use event::{Event, NotForwarded};
pub use exchange::{Input, Output};
pub use odometry::{CYCLE_S, Counters, Odometry, Scale, Step, Track};
pub use parameters::{Factors, Parameters};
pub use port::{Port, words};
pub use probe::{Answer, ProbeError, probe};
pub use readings::{Readings, readings};
pub use scanner::{Doubt, Refusals, Scanner};
pub use session::Session;
pub use share::{Share, ShareError, Shared};
