//! `[sbs]`: statistical background subtraction.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::bounded::bounded;

bounded! {
    /// Pictures.
    TrainingFrames: u32 in 0..=200, "frames", default 15;
    /// Standard deviations.
    Deviations: f64 in 1.0..=10.0, "", default 3.0;
    /// A factor of a covariance.
    CovarianceFactor: f64 in 0.0..=100.0, "", default 0.25;
    /// A squared Mahalanobis distance.
    RegionBound: f64 in 0.0..=100.0, "", default 4.0;
    /// An area in a picture 160 wide; it grows with the square of the width.
    BlobArea: f64 in 1.0..=10000.0, "px", default 40.0;
    /// Pictures after which what stands still is background.
    Takeover: u32 in 1..=255, "frames";
}

/// The method that finds the motion of the camera.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum SbsMethod {
    /// Direct alignment of all pixels by robust Gauss-Newton steps.
    #[default]
    Direct,
    /// Landmarks, iterative closest point and least squares, as the paper's section 5 prints it.
    Paper,
}

/// How freely the background may move from picture to picture.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Freedom {
    /// Shift, turn and scale.
    #[default]
    Similarity,
    /// Six parameters.
    Affine,
    /// Eight parameters.
    Homography,
}

/// `[sbs]`: statistical background subtraction (the paper's section 5). The horizon and the field of view are the camera's.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields, expecting = "a table")]
pub struct Sbs {
    /// Method that finds the motion of the camera.
    pub method: SbsMethod,
    /// How freely the background may move: more freedom fits the walkers, too.
    pub freedom: Freedom,
    /// Pictures from which the background is learned while the robot stands still at the start; 0: none.
    pub training_frames: TrainingFrames,
    /// k: a value within so many standard deviations of the background's is background.
    pub k: Deviations,
    /// β of eq. 8: by how much the residuals of the motion widen the region that a pixel is compared with.
    pub beta: CovarianceFactor,
    /// ħ of eq. 6: how far that region reaches.
    pub h_bar: RegionBound,
    /// Smallest area of a blob.
    pub min_area_px: BlobArea,
    /// Number of pictures after which an object that has come to rest becomes background.
    pub takeover_frames: Takeover,
    /// Number of pictures after which it becomes background where the picture does not change at all.
    pub takeover_still_frames: Takeover,
}

impl Default for Sbs {
    fn default() -> Self {
        Self {
            method: SbsMethod::default(),
            freedom: Freedom::default(),
            training_frames: TrainingFrames::default(),
            k: Deviations::default(),
            beta: CovarianceFactor::default(),
            h_bar: RegionBound::default(),
            min_area_px: BlobArea::default(),
            takeover_frames: Takeover::literal(60),
            takeover_still_frames: Takeover::literal(12),
        }
    }
}
