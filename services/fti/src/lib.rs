#![cfg_attr(test, allow(clippy::unwrap_used, clippy::panic, clippy::float_cmp, reason = "tests fail by panicking"))]

//! Fuzzy-tuned integration (FTI, paper section 6): which readings a moving thing caused.
//!
//! What the sonars and the camera see moving is brought together four ways:
//!
//! - *pairs*: a moving class and a blob that correspond (eq. 11) give an update region through Tables 3 to 5 and eq. 1;
//! - *tracks*: each walker is followed in the map frame by blobs, echoes and movers;
//! - *evidence*: for each cell, how often something was found there and how often nothing;
//! - *runs*: how long each sonar hears the same thing, which a passer-by leaves sooner than what the robot passes.
//!
//! Each reading gets its verdict at the commit horizon, with everything seen until then: by the likelihood ratio of a walker
//! against something that stands there, or by the paper's own rule. Without a camera the tracks come from the sonars alone,
//! and the verdict says so.
//!
//! The service is a fold: [`Fti::step`] takes the inputs in any order of arrival and works in the order of sensor time.

mod answer;
mod arc;
mod dwell;
mod evidence;
mod gating;
mod observe;
mod parameters;
mod pending;
mod pipeline;
mod region;
mod sight;
mod smoothed;
mod state;
mod still;
mod streams;
mod tables;
mod track;
mod tracks;
mod variables;
mod verdict;

pub use answer::Verdict;
pub use evidence::Grounds;
pub use parameters::{Action, Camera, Cue, Parameters, ParametersError, Patience, Rule};
pub use pipeline::Fti;
pub use state::StateError;
pub use streams::Input;
pub use tables::{Magnitude, Side, Tables};
pub use variables::{Variable, variables};
