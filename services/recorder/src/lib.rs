//! The log of a run on its way to the disk.
//!
//! The recorder writes every message of the services that a log holds, with the simulator's truth and the health of the processes.
//! It flushes the log every second. A recorder that is killed loses the messages since the last flush; the next one continues in
//! the next part (`drive.2.mcap`, …). A message is acknowledged once it is in the file, so that lockstep sends nothing that a
//! killed recorder could miss.
//!
//! When the disk is full the recorder reports it, counts what it drops and keeps running. Once there is space again it ends that
//! file and continues in the next part. A long log continues in the next part as well, so that the index of a file takes at most a
//! megabyte of memory.
//!
//! - [`LogBuffer`]: what is recorded and not yet written.
//! - [`LogFile`]: the file of one part.
//!
//! The process that joins them to the bus is in the `stillmap` command.
#![cfg_attr(test, allow(clippy::unwrap_used, clippy::panic, clippy::float_cmp, reason = "tests fail by panicking"))]

mod buffer;
mod file;

pub use buffer::LogBuffer;
pub use file::LogFile;
