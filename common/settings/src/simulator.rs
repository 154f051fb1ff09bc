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
    /// The world's file; relative to the settings file.
    #[serde(deserialize_with = "crate::text::path")]
    #[schemars(extend("x-form" = "path"))]
    pub world: PathBuf,
    /// Seed of everything random in the world: the same seed gives the same drive.
    pub seed: Seed,
}

impl Default for Simulator {
    fn default() -> Self {
        Self { world: PathBuf::from("worlds/corridor.toml"), seed: Seed::default() }
    }
}
