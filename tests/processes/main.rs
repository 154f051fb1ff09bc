//! Single processes on a bus of their own.

#![allow(clippy::unwrap_used, clippy::panic, clippy::float_cmp, reason = "tests fail by panicking")]

mod mapping;
mod pioneer;
mod playback;
mod sbs;
mod simulator;
#[path = "../../services/sbs/tests/common/wall.rs"]
mod wall;
