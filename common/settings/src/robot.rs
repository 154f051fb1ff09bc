//! `[robot]`: the robot's body and sonars.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::bounded::{bounded, one_of};

bounded! {
    /// Range at and above which a reading is no echo.
    RangeLimit: f64 in 0.2..=10.0, "m", default 3.0;
    /// A place on the robot.
    MountOffset: f64 in -2.0..=2.0, "m";
    /// A direction on the robot, counter-clockwise from straight ahead.
    MountHeading: f64 in -180.0..=180.0, "deg";
}

one_of! {
    /// The number at which the robot's odometry counters start again from 0.
    OdometryModulus: u32 of [4096, 32768, 65536], default 32768;
}

/// A type of robot: fixes the factors of its serial protocol and its sonar ring.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Model {
    /// Pioneer 1, seven sonars.
    #[default]
    #[serde(rename = "pioneer-1")]
    Pioneer1,
    /// Pioneer AT, seven sonars.
    PioneerAt,
    /// Pioneer 2 DX.
    P2Dx,
    /// Pioneer 3 DX.
    P3Dx,
}

/// `[robot]`: the robot's body and sonars.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields, expecting = "a table")]
pub struct Robot {
    /// The type of robot.
    pub model: Model,
    /// A reading at or above this range is no echo.
    pub range_limit_m: RangeLimit,
    /// The number at which the robot's odometry counters start again from 0; depends on its firmware.
    pub odometry_modulus: OdometryModulus,
    /// `[[robot.sonar]]`: the sonar ring, in the order of the sonars' numbers. Without it, the ring of the model.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    #[schemars(length(max = 16))]
    pub sonar: Vec<Sonar>,
}

/// `[[robot.sonar]]`: where a sonar sits and looks, in the robot frame.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "a table")]
pub struct Sonar {
    /// Forward of the robot's centre.
    pub x_m: MountOffset,
    /// To the left of the robot's centre.
    pub y_m: MountOffset,
    /// Direction of the beam's axis, counter-clockwise from straight ahead.
    pub heading_deg: MountHeading,
}
