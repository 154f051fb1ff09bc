//! `[localisation]`: where the robot is in the map.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Whether walls are taken to meet at right angles.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum RightAngles {
    /// Once a long wall gives the direction of the building; a wall that disagrees counts little.
    #[default]
    Auto,
    /// Always.
    On,
    /// Never.
    Off,
}

/// `[localisation]`: where the robot is in the map, from walls and from odometry that drifts. Without a process that runs
/// "localisation", odometry is taken as exact.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields, expecting = "a table")]
pub struct Localisation {
    /// Whether walls are taken to meet at right angles. "off" is for buildings in which most do not.
    pub right_angles: RightAngles,
}
