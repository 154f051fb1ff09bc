//! `[simulator]`: a simulated world with its robot.

use std::path::PathBuf;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::bounded::bounded;

bounded! {
    /// Seed of everything random in the world.
    Seed: u32 in 0..=4294967295, "", default 1;
}

/// `[simulator]`: a simulated world with its robot.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields, expecting = "a table")]
pub struct Simulator {
    /// World file, relative to the settings file.
    #[serde(deserialize_with = "crate::text::path")]
    #[schemars(extend("x-form" = "path"))]
    pub world: PathBuf,
    /// Seed of all random numbers. The same seed gives the same drive.
    pub seed: Seed,
    /// Link to the serial port of the simulated robot for programs outside of the deployment, relative to the settings file.
    #[serde(deserialize_with = "crate::text::optional_path", skip_serializing_if = "Option::is_none")]
    #[schemars(extend("x-form" = "path"))]
    pub link: Option<PathBuf>,
    /// `[simulator.camera]`: the simulated camera.
    pub camera: SimulatedCamera,
}

/// What the simulated camera gives.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Provides {
    /// Nothing.
    #[default]
    Off,
    /// Pictures of the world, for background subtraction, with the truth of every pixel.
    Pictures,
}

/// `[simulator.camera]`: the simulated camera.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields, expecting = "a table")]
pub struct SimulatedCamera {
    /// What the simulated camera publishes.
    pub provides: Provides,
}

impl Default for Simulator {
    fn default() -> Self {
        Self { world: PathBuf::from("worlds/corridor.toml"), seed: Seed::default(), link: None, camera: SimulatedCamera::default() }
    }
}
