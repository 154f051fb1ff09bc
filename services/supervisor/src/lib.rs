//! Starts, watches and restarts the processes of a deployment.
//!
//! What is to be done is decided by a state machine over values, [`Deployment`]: `(state, event, now) -> actions`. The shell
//! around it, [`run()`], holds the domain on the bus, the children, the clock and the signals. Children are started in the
//! order of the settings, each once the one before has given a sign of life; heartbeats come from the work loop of a process,
//! so that one that hangs is silent, and is killed and started again. Nothing outlives the supervisor: children get SIGKILL
//! from the kernel when it dies, and a [`guard()`] removes the domain then.
//!
//! To a process the contract is: the environment `STILLMAP_*` says where it belongs; SIGTERM asks it to finish what it holds;
//! exit code 0 says that its work is done, 2 that its input cannot be used, [`bus::EXIT_BROKEN_DOMAIN`] that the shared
//! memory is unusable; after any other end it is started again. A SIGTERM or SIGINT of anybody else ends a process with a
//! [`runtime::Shell`] at once, so that it is. What it writes to standard output and error becomes log lines under its name.
#![cfg_attr(test, allow(clippy::unwrap_used, clippy::panic, clippy::float_cmp, reason = "tests fail by panicking"))]

mod child;
mod deployment;
mod disk_sync;
mod events;
mod executable;
mod guard;
mod hook;
mod kernel;
mod leftovers;
mod lifecycle;
mod limits;
mod lines;
mod notices;
mod outcome;
mod output_lock;
mod patience;
mod plan;
mod policy;
mod ports;
mod program;
mod removal;
mod requests;
mod run;
mod running;
mod service;
mod signals;
mod usage;
mod vitals;
mod watch;

pub use child::EXIT_BAD_INPUT;
pub use deployment::Deployment;
pub use events::{Action, Ending, Event, Notice, Standstill};
pub use guard::{GuardError, guard};
pub use kernel::check_kernel;
pub use lifecycle::{Exit, Lifecycle, Plan, Role, State};
pub use notices::CHILD_TARGET;
pub use outcome::{EXIT_INCOMPLETE, Outcome, ProcessOutcome};
pub use output_lock::OutputFolder;
pub use policy::{Policy, Restarts};
pub use program::{ProgramError, find_program};
pub use requests::request_restart;
pub use run::{needed_memory, run};
pub use running::{Options, Report, RunError};
pub use signals::StopAsked;
