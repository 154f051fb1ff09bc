//! The log of a run on its way to the disk.
//!
//! The recorder writes every message of the services that a log holds, with the simulator's truth and the health of the processes.
//! It flushes the log every second. A recorder that is killed loses the messages since the last flush; the next one continues in
//! the next part (`drive.2.mcap`, …). A message is acknowledged once it is in the file, so that lockstep sends nothing that a
//! killed recorder could miss.
//!
//! When the disk is full the recorder reports it, counts what it drops and keeps running. Once there is space again it ends that
//! file and continues in the next part. A file that fails in another way, or that was removed, moved or truncated, is left: the next
//! part begins with the messages that were not written. A long log continues in the next part as well, so that the index of a file
//! takes at most a megabyte of memory. At the end every part is compared with what was written.
//!
//! - [`RunLog`]: the log of a run, part after part.
//! - [`Limits`]: the space that it may take.
//! - [`LogBuffer`]: what is recorded and not yet written.
//! - [`LogFile`]: the file of one part.
//! - [`WrittenPart`]: what was written, to be compared with what is there.
//!
//! The process that joins them to the bus is in the `stillmap` command.
#![cfg_attr(test, allow(clippy::unwrap_used, clippy::panic, clippy::float_cmp, reason = "tests fail by panicking"))]

mod buffer;
mod file;
mod limits;
mod run_log;
mod written;

pub use buffer::LogBuffer;
pub use file::LogFile;
pub use limits::Limits;
pub use run_log::{RunLog, Written};
pub use written::{Change, WrittenPart};
