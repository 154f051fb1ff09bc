//! The drivers against a real kernel's devices. These tests run in the virtual machine that `tests/device/run` makes.
#![expect(clippy::unwrap_used, clippy::panic, reason = "tests fail by panicking")]

mod adapter;
mod camera_faults;
mod camera_kills;
mod deployment;
mod first_look;
#[path = "../harness/mod.rs"]
#[allow(dead_code, unused_imports, reason = "the tests of whole deployments use the rest")]
mod harness;
mod serial;
mod vivid;
mod wall_clock;

use harness::Deployment;

/// A deployment of these processes with patience: an emulated machine on a busy host is slow, and no process of it is to be taken for hung.
fn deployment(name: &str, programs: &[&str]) -> Deployment {
    Deployment::new(name, programs).patient()
}
