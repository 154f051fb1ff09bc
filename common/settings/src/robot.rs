//! `[robot]`: the robot's body and sonars.

use std::borrow::Cow;

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::{Deserialize, Serialize};

use crate::bounded::{bounded, one_of};
use crate::text::BadText;

bounded! {
    /// Range at and above which a reading is no echo.
    RangeLimit: f64 in 0.2..=10.0, "m", default 3.0;
    /// A place on the robot.
    MountOffset: f64 in -2.0..=2.0, "m";
    /// A length that a unit of the robot's packets stands for.
    UnitLength: f64 in 0.001..=20.0, "mm";
    /// Units of a full turn of the robot's heading.
    HeadingUnits: u32 in 90..=32767, "";
    /// A direction on the robot, counter-clockwise from straight ahead.
    MountHeading: f64 in -180.0..=180.0, "deg";
}

one_of! {
    /// The number at which the robot's odometry counters start again from 0.
    OdometryModulus: u32 of [4096, 32768, 65536], default 32768;
}

/// A type of robot: fixes the factors of its serial protocol and its sonar ring.
#[derive(Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "String", into = "&'static str")]
pub struct Model(&'static psos::Model);

impl Model {
    /// What is known of it.
    #[must_use]
    pub fn get(self) -> &'static psos::Model {
        self.0
    }
}

impl core::fmt::Debug for Model {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        self.0.name.fmt(f)
    }
}

impl Default for Model {
    fn default() -> Self {
        Self(&psos::MODELS[0])
    }
}

impl TryFrom<String> for Model {
    type Error = BadText;

    fn try_from(name: String) -> Result<Self, BadText> {
        let expected =
            "a type of robot, as `stillmap pioneer probe` tells it: \"pioneer-1\", \"p3-dx\", \"p2at\" … (SETTINGS.md lists them)";
        psos::Model::named(&name).map(Self).ok_or(BadText { expected })
    }
}

impl From<Model> for &'static str {
    fn from(model: Model) -> Self {
        model.0.name
    }
}

impl JsonSchema for Model {
    fn schema_name() -> Cow<'static, str> {
        "Model".into()
    }

    fn inline_schema() -> bool {
        true
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        let names: Vec<_> = psos::MODELS.iter().flat_map(psos::Model::names).collect();
        json_schema!({ "type": "string", "enum": names })
    }
}

/// `[robot]`: the robot's body and sonars.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields, expecting = "a table")]
pub struct Robot {
    /// Type of the robot, by its name or by the subclass that it reports. `stillmap pioneer probe` prints it.
    pub model: Model,
    /// Length that a unit of x and y in the packets stands for. The default is that of the model.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub distance_unit_mm: Option<UnitLength>,
    /// Length that a unit of a sonar range in the packets stands for. The default is that of the model.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub range_unit_mm: Option<UnitLength>,
    /// Number of units in a full turn of the heading. The default is that of the model.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub heading_units: Option<HeadingUnits>,
    /// Range at and above which a reading counts as "no echo".
    pub range_limit_m: RangeLimit,
    /// Number at which the odometry counters of the robot wrap to 0. It depends on the firmware.
    pub odometry_modulus: OdometryModulus,
    /// `[[robot.sonar]]`: the sonar ring in the order of the sonar numbers. The default is the ring of the model.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    #[schemars(length(max = 32))]
    pub sonar: Vec<Sonar>,
}

/// `[[robot.sonar]]`: position and direction of a sonar in the robot frame.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "a table")]
pub struct Sonar {
    /// Position of the sonar, forward of the centre of rotation.
    pub x_m: MountOffset,
    /// Position of the sonar, to the left of the centre of rotation.
    pub y_m: MountOffset,
    /// Direction of the axis of the beam, counter-clockwise from straight ahead.
    pub heading_deg: MountHeading,
}
