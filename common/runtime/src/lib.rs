//! The shell of every stillmap process.
//!
//! A process joins its deployment with a [`Shell`], declares its inputs and outputs and hands over a [`Process`], whose `step` the
//! shell calls whenever something is there to be done. The shell sends the heartbeat and the progress, takes requests to stop and
//! ends the process in order. A [`Checkpoint`] holds the state of a process between its starts, a [`RunState`] those of a whole
//! run, and [`CheckpointSets`] what a power cut leaves of them. A [`Observer`] looks at a running deployment.
//!
//! Modes of failure that this crate answers for: a hung work loop sends no heartbeat, since no other thread does; a checkpoint is
//! read whole or not at all.
#![cfg_attr(test, allow(clippy::unwrap_used, reason = "tests fail by panicking"))]

mod answers;
mod aside;
mod checkpoint;
mod checkpoint_set;
mod fold;
mod journal;
mod note;
mod observer;
mod recent;
mod run_state;
mod settling;
mod shell;
mod signals;

pub use answers::Answers;
pub use checkpoint::{Checkpoint, Parts, Snapshot};
pub use checkpoint_set::CheckpointSets;
pub use fold::{Fold, run_fold};
pub use journal::PartKey;
pub use observer::Observer;
pub use recent::Recent;
pub use run_state::{PersistedState, RunState};
pub use settling::Settling;
pub use shell::{Context, Next, Process, RunError, Shell, StepError};
pub use signals::{Signals, flag_of_ends};
