//! `[simulator]`: a simulated world with its robot.

use std::path::PathBuf;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::bounded::bounded;

bounded! {
    /// Seed of everything random in the world.
    Seed: u32 in 0..=4294967295, "", default 1;
    /// A share of what there is.
    Share: f64 in 0.0..=1.0, "";
    /// A number of things in a picture, on average.
    PerPicture: f64 in 0.0..=4.0, "";
    /// A time after which something happens.
    After: f64 in 0.0..=3600.0, "s";
    /// A distance in the picture.
    Pixels: f64 in 0.0..=50.0, "px";
    /// A share by which a length is wrong.
    LengthError: f64 in 0.0..=0.5, "";
    /// A distance by which a height is wrong.
    HeightError: f64 in 0.0..=0.5, "m";
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
    /// `[simulator.camera]`: what the robot's camera gives.
    pub camera: SimulatedCamera,
}

/// What the simulated camera gives.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Provides {
    /// Nothing.
    #[default]
    Off,
    /// What background subtraction would report of the walkers, made from the truth, with the failings below.
    Motion,
    /// Pictures of the world, for background subtraction, with the truth of every pixel.
    Pictures,
}

/// `[simulator.camera]`: what the robot's camera gives, and how background subtraction fails where it is only pretended.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields, expecting = "a table")]
pub struct SimulatedCamera {
    /// What it gives.
    pub provides: Provides,
    /// Share of blobs that are missed.
    pub missed: Share,
    /// Share of blobs that fall to pieces; of a third of these the feet are lost.
    pub fragments: Share,
    /// False blobs in a picture, on average.
    pub false_blobs: PerPicture,
    /// A walker who stands fades into the background after this time.
    pub fades_after_s: After,
    /// Spread of a blob's edges.
    pub edge_px: Pixels,
    /// The true focal length differs by this share from what `[camera]` says,
    pub focal_error: LengthError,
    /// the true horizon by so many rows,
    pub horizon_error_px: Pixels,
    /// and the true height of the camera by this. The directions are the seed's.
    pub height_error_m: HeightError,
}

impl Default for Simulator {
    fn default() -> Self {
        Self { world: PathBuf::from("worlds/corridor.toml"), seed: Seed::default(), camera: SimulatedCamera::default() }
    }
}

impl Default for SimulatedCamera {
    fn default() -> Self {
        Self {
            provides: Provides::default(),
            missed: Share::literal(0.08),
            fragments: Share::literal(0.15),
            false_blobs: PerPicture::literal(0.2),
            fades_after_s: After::literal(0.8),
            edge_px: Pixels::literal(1.0),
            focal_error: LengthError::literal(0.03),
            horizon_error_px: Pixels::literal(2.0),
            height_error_m: HeightError::literal(0.03),
        }
    }
}
