#![cfg_attr(
    test,
    allow(
        clippy::unwrap_used,
        clippy::panic,
        clippy::float_cmp,
        reason = "tests fail by panicking, on exact values where these are exact"
    )
)]

//! Fuzzy-tuned grid-based mapping (FTGBM), the owner of the map.

mod cone;
#[cfg(test)]
mod golden;
mod integrate;
mod numeric;
mod parameters;
mod sensor_model;
mod tuning;

pub use parameters::{Parameters, ParametersError};

#[doc(hidden)]
pub fn integrate_reading(
    lattice: &mut grid::Lattice<f32>,
    parameters: &Parameters,
    pose: &messages::Pose,
    reading: &messages::SonarReading,
) {
    integrate::integrate(lattice, parameters, pose, reading, false);
}
