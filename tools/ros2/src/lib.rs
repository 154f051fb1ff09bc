//! Bags of ROS 2 into logs, and logs into bags.
#![cfg_attr(test, allow(clippy::unwrap_used, clippy::panic, clippy::float_cmp, reason = "tests fail by panicking"))]

mod bag;
mod bag_writer;
mod camera_mount;
mod cdr;
mod damages;
mod error;
mod export;
#[cfg(test)]
mod export_tests;
mod files;
mod import;
mod interfaces;
mod markers;
mod message;
mod occupancy;
mod picture;
mod scans;
mod sqlite;
mod survey;
mod tally;
mod trajectory;
mod transforms;
mod visit;

pub use bag::Bag;
pub use camera_mount::{CameraMount, Optics};
pub use error::BagError;
pub use export::{Exported, Sensors, export};
pub use import::{Imported, import};
pub use survey::{CameraFound, SonarFound, Survey, survey};
