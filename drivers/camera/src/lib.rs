//! Driver of a V4L2 camera: its pictures in luminance, and its faults in words.
//!
//! | part | does |
//! | --- | --- |
//! | [`Session`] | the next action: open, restart, close; survives every fault |
//! | [`FixedControls`] | the controls that a user sets to fixed values |
//! | [`Shape`] | from a device's bytes to luminance, in one pass |
//! | [`Camera`], [`Device`], [`Stream`] | the device itself, through the kernel's calls (`abi`) |
//! | [`offer`], [`snapshot()`] | what a user asks about a camera before the first drive |
//!
//! The first three open no device and read no clock.
//!
//! *Lost*: the device counted a picture that it did not give. *Damaged*: it gave one that is none. *Stalled*: it gives none though
//! nothing is known to be wrong.
#![cfg_attr(test, allow(clippy::unwrap_used, clippy::panic, clippy::float_cmp, reason = "tests fail by panicking"))]

mod abi;
mod clock;
mod coding;
mod config;
mod controls;
mod device;
mod four_cc;
mod list;
mod session;
mod snapshot;
mod stream;
mod trouble;

pub use clock::monotonic_ns;
pub use coding::{Coding, Damage, Shape};
pub use config::{Camera, CameraConfig, Given};
pub use controls::{ControlInfo, ControlSetting, ControlTrouble, FixedControls};
pub use device::{Device, Identity};
pub use four_cc::FourCc;
pub use list::{Offer, OfferedFormat, devices, offer};
pub use session::{Counters, Event, Input, Limits, Output, Session};
pub use snapshot::{Snapshot, SnapshotError, snapshot};
pub use stream::{About, Frame, Stream};
pub use trouble::Trouble;
