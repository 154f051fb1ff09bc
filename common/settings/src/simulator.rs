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
    /// The motion that background subtraction would report, made from the truth with the errors of `[simulator.camera.motion]`.
    Motion,
    /// Pictures of the world, for background subtraction, with the truth of every pixel.
    Pictures,
}

/// `[simulator.camera]`: the simulated camera.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields, expecting = "a table")]
pub struct SimulatedCamera {
    /// What the simulated camera publishes.
    pub provides: Provides,
    /// `[simulator.camera.motion]`: errors of the camera motion that is made from the truth. Refused unless `provides` is "motion".
    pub motion: SimulatedMotion,
}

/// `[simulator.camera.motion]`: errors of the camera motion that is made from the truth.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields, expecting = "a table")]
pub struct SimulatedMotion {
    /// Share of the blobs that are missed.
    pub missed: Share,
    /// Share of the blobs that break into pieces. A third of these lose the feet of the person.
    pub fragments: Share,
    /// Mean number of false blobs per picture.
    pub false_blobs: PerPicture,
    /// Time after which a stationary walker fades into the background.
    pub fades_after_s: After,
    /// Standard deviation of the edges of a blob.
    pub edge_px: Pixels,
    /// Share by which the true focal length differs from that of `[camera]`, in the direction that the seed chooses.
    pub focal_error: LengthError,
    /// Number of rows by which the true horizon differs from that of `[camera]`, in the direction that the seed chooses.
    pub horizon_error_px: Pixels,
    /// Distance by which the true height of the lens differs from that of `[camera]`, in the direction that the seed chooses.
    pub height_error_m: HeightError,
}

impl Default for Simulator {
    fn default() -> Self {
        Self { world: PathBuf::from("worlds/corridor.toml"), seed: Seed::default(), link: None, camera: SimulatedCamera::default() }
    }
}

impl Default for SimulatedMotion {
    fn default() -> Self {
        Self {
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
