//! Fault injection: between publishers and readers of a service, on processes, and on shared memory.
//!
//! A service that the settings route through the injector has two channels: its publishers send to the injector, and the injector
//! sends to its readers. Neither of them is built for it.
//!
//! - [`FaultQueue`] decides what happens to each message of a service. Whether a fault hits a message depends on the seed of the
//!   fault and the sequence number of the message alone, so that a repeated run and a republished message meet the same faults.
//! - [`Schedule`] decides when to act on a process ([`Target`]) or to take shared memory ([`MemoryFill`]).
//! - [`Report`] is the log line about the begin or the end of a fault.
//! - [`request_fault`] hands a fault to a running injector.
//!
//! The parameters of a fault are those of the settings, [`settings::PlannedFault`]. The process that joins all of this to the bus is
//! in the `stillmap` command.
#![cfg_attr(test, allow(clippy::unwrap_used, clippy::panic, clippy::float_cmp, reason = "tests fail by panicking"))]

mod describe;
mod memory_fill;
mod queue;
mod random;
mod request;
mod schedule;
mod target;

pub use describe::{Report, Source};
pub use memory_fill::{MemoryFill, MemoryFillError};
pub use queue::{Counts, Envelope, FaultQueue};
pub use request::{RequestError, request_fault, take_requests};
pub use schedule::{Action, ProcessAction, Schedule};
pub use target::{Target, TargetError};
