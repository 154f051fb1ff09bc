//! The drivers against a real kernel's devices. These tests run in the virtual machine that `tests/device/run` makes.
#![expect(clippy::unwrap_used, clippy::panic, reason = "tests fail by panicking")]

mod adapter;
mod camera_faults;
mod camera_kills;
mod deployment;
mod first_look;
#[path = "../harness/mod.rs"]
mod harness;
mod serial;
mod vivid;
mod wall_clock;

/// For every deployment here: an emulated machine on a busy host takes its time, and is not to be thought dead.
const PATIENT: &str = "[supervisor]\nstartup_deadline_s = 60\nheartbeat_timeout_s = 60\nstop_deadline_s = 60\n";
