#![cfg_attr(
    test,
    allow(
        clippy::unwrap_used,
        clippy::panic,
        clippy::float_cmp,
        reason = "tests fail by panicking, on exact values where these are exact"
    )
)]

//! Where the robot is in the map, from odometry that drifts.
//!
//! The service is a fold: [`Localisation::step`] answers every scan with the odometry's frame in the map, and the whole state can be
//! written and read back. Poses of scans that have left the commit horizon go into the map; a [`Revision`] corrects them later.

mod adjustment;
mod answer;
mod closure;
mod envelope;
mod fit;
mod graph;
mod horizon;
mod localisation;
mod noise;
mod outgoing;
mod parameters;
mod revision;
mod rigid;
mod runs;
mod state;
mod tracking;

pub use answer::{Answer, Calibration, Closure, Moved, Revision, Smoothed, Status, Wall};
pub use localisation::Localisation;
pub use outgoing::{Facts, Outgoing};
pub use parameters::{Parameters, ParametersError, RightAngles};
pub use state::StateError;
