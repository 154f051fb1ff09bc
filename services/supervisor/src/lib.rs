//! Starts, watches and restarts the processes of a deployment.
#![cfg_attr(test, allow(clippy::unwrap_used, clippy::panic, clippy::float_cmp, reason = "tests fail by panicking"))]

mod deployment;
mod lifecycle;
mod policy;

pub use deployment::{Action, Deployment, Ending, Event, Notice};
pub use lifecycle::{Exit, Lifecycle, Plan, Role, State};
pub use policy::{Policy, Restarts};
