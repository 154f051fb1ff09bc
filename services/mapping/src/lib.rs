#![cfg_attr(
    test,
    allow(
        clippy::unwrap_used,
        clippy::panic,
        clippy::float_cmp,
        reason = "tests fail by panicking, on exact values where these are exact"
    )
)]

//! Fuzzy-tuned grid-based mapping (FTGBM, section 3 of the paper), the owner of the map.
//!
//! [`Mapper`] is the whole of it as a fold: scans and the verdicts on them in, lattices of log-odds out. It opens no file and
//! reads no clock; the same scans and verdicts give the same map, to the byte.
//!
//! - A reading is integrated by the sensor model (eq. 2), tuned by fuzzy rules (eq. 1) from what its cone holds, with Bayes' rule
//!   (eq. 3) as a clamped sum of log-odds.
//! - It stays *pending* until it is decided whether a moving thing caused it: by its verdict, or at the commit horizon. What is
//!   *shown* is the committed lattice with the pending readings on top.
//! - [`export`] makes the files that people and other robots read.

mod committed;
mod cone;
mod despeckle;
mod digest;
pub mod export;
mod files;
#[cfg(test)]
mod golden;
mod integrate;
mod layer;
mod localised;
mod localised_state;
mod mapper;
mod numeric;
mod occupied;
mod parameters;
mod pending;
mod placed;
#[cfg(test)]
mod reference;
mod robot_path;
mod saved;
mod sensor_model;
mod state;
mod tuning;

pub use files::{WriteError, write_files};
pub use mapper::{Counts, Input, Mapper, Refused};
pub use occupied::{OCCUPIED, is_occupied};
pub use parameters::{CommitRule, Fades, Parameters, ParametersError, PoseRule, SensorParameters, TuningParameters};
pub use saved::StateError;

const _: () = assert!(geometry::TILE_EDGE == messages::TILE_EDGE);
