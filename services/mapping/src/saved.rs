//! What the parts of a saved state have in common: their error, poses and the trajectory.

use geometry::MapFromRobot;
use postcard_schema::Schema;
use serde::{Deserialize, Serialize};
use state::{DecodeError, Packed};

use crate::robot_path::{MAX_LENGTH_M, MAX_PLACES, RobotPath};

/// Bytes that are no state of a mapper with these parameters.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum StateError {
    /// They are of another version or damaged.
    #[error(transparent)]
    Bytes(#[from] DecodeError),
    /// A value that no mapper with these parameters has.
    #[error("{found}, expected {expected}")]
    Value {
        /// What is there.
        found: String,
        /// What should be.
        expected: &'static str,
    },
}

/// A pose in the map frame. A revision may move a pose beyond what messages allow.
pub(crate) fn pose([x_m, y_m, yaw_rad]: [f64; 3]) -> Result<MapFromRobot, StateError> {
    let is_somewhere = [x_m, y_m].iter().all(|at_m| at_m.abs() <= 1e7) && yaw_rad.is_finite();
    require(is_somewhere, format!("{x_m} {y_m} {yaw_rad}"), "a pose within 10000 km")?;
    Ok(MapFromRobot::new(x_m, y_m, yaw_rad))
}

/// A trajectory.
#[derive(Serialize, Deserialize, Schema)]
pub(crate) struct SavedPath<'a> {
    step_m: f64,
    length_m: f64,
    places_m: Packed<'a, [f32; 2]>,
}

impl<'a> From<&'a RobotPath> for SavedPath<'a> {
    fn from(path: &'a RobotPath) -> Self {
        Self { step_m: path.step_m, length_m: path.length_m, places_m: Packed::from(&path.places_m[..]) }
    }
}

impl SavedPath<'_> {
    pub(crate) fn restore(self) -> Result<RobotPath, StateError> {
        let Self { step_m, length_m, places_m } = self;
        let places_m = places_m.into_vec();
        require(step_m > 0.0 && step_m.is_finite(), step_m, "a step of the path above 0")?;
        require((0.0..=MAX_LENGTH_M).contains(&length_m), length_m, "a length of the path")?;
        require(places_m.len() <= MAX_PLACES, places_m.len(), "at most 16384 points of the path")?;
        let far = places_m.iter().find(|place| !place.iter().all(|number| number.abs() <= 1e7));
        far.map_or(Ok(()), |place| Err(error(format!("{place:?}"), "a point within 10000 km")))?;
        Ok(RobotPath::restored(step_m, length_m, places_m))
    }
}

pub(crate) fn require(holds: bool, found: impl std::fmt::Display, expected: &'static str) -> Result<(), StateError> {
    if holds { Ok(()) } else { Err(error(found.to_string(), expected)) }
}

pub(crate) fn error(found: String, expected: &'static str) -> StateError {
    StateError::Value { found, expected }
}
