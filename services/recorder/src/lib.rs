//! Everything on the bus into one log.
//!
//! The recorder takes every message of the deployment, truth and health among them, and flushes the log every second: killed
//! with `kill -9`, it loses what came since, and goes on in the next part (`drive.2.mcap`, …) when it is started again. A
//! message counts as answered once it is in the file, so that in lockstep nothing is sent that a killed recorder could miss.
//! When the disk is full it says so, keeps running, and ends that file and goes on in the next when there is space again. A long
//! log goes on in the next part, too, so that the index of a file never takes more than a megabyte of memory.
#![cfg_attr(test, allow(clippy::unwrap_used, clippy::panic, clippy::float_cmp, reason = "tests fail by panicking"))]

mod file;
mod tape;

pub use file::LogFile;
pub use tape::Tape;
