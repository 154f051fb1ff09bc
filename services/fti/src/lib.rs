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
//! Constants that decide a verdict carry their measured effect: *half* and *twice* are the share of ghost cells that are removed and
//! the share of wall cells that are lost with half and with twice the constant, all others as they are; with every constant as it is
//! they are 85.0 % / 1.35 %. Measured over the five worlds of `config/worlds` with walkers, seeds 101 to 108, three walkers, and
//! motion of the camera that is computed from the truth and not from pictures:
//! `stillmap evaluate --world … --seeds 101..108 --walkers 3`.
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
pub use evidence::LogLikelihoods;
pub use parameters::{Action, Camera, Cue, Parameters, ParametersError, Patience, Rule};
pub use pipeline::Fti;
pub use state::StateError;
pub use streams::Input;
pub use tables::{Magnitude, Side, Tables};
pub use variables::{Variable, variables};
