#![cfg_attr(test, allow(clippy::unwrap_used, clippy::panic, clippy::float_cmp, reason = "tests fail by panicking"))]

//! Sonar temporal difference (STD, paper section 4): what moves, as the sonars see it.
//!
//! Every scan tags the cells that its echoes fall in (time-variant map, TVM). Adjacent tagged cells are one class. A class
//! whose cells were not tagged a moment ago is of a moving object (`CELL_mov`), otherwise of a stationary one (`CELL_sat`).
//! By the paper's own rule that is all; by the rule *visible*, which is the default, a cell must also have been seen free
//! lately: a wall that comes into view for the first time was not tagged before either.
//!
//! The service is a fold: [`Std::step`] answers every scan, and the whole state can be written and read back.

mod classes;
mod parameters;
mod seen_free;
mod state;
mod step;
mod tracks;
mod tvm;

pub use parameters::{Parameters, ParametersError, Rule};
pub use state::StateError;
pub use step::Std;
pub use tracks::Track;
