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

mod codec;
mod cone;
mod digest;
#[cfg(test)]
mod golden;
mod integrate;
mod layer;
mod mapper;
mod numeric;
mod parameters;
mod pending;
#[cfg(test)]
mod reference;
mod sensor_model;
mod state;
mod tuning;
mod way;

pub use codec::StateError;
pub use mapper::{Counts, Input, Mapper, Refused};
pub use parameters::{Parameters, ParametersError};

const _: () = assert!(grid::TILE_EDGE == messages::TILE_EDGE);
