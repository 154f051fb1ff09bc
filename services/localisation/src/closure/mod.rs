//! Recognising a place: the echoes of the last metres are laid on those of an earlier stretch.
//!
//! A single scan of a few sonars shows too little. A stretch of path shows pieces of wall on both sides, and two stretches along
//! the same walls have them in common.

mod correlation;
mod field;
mod search;

pub(crate) use search::{Search, SearchWork};

use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

/// A place that an echo came from, in the frame of a node.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, Schema)]
pub(crate) struct Point {
    x: f32,
    y: f32,
    /// Direction from the sonar: it tells the two sides of a wall apart.
    facing: f32,
    weight: f32,
}
