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

/// Motion model of the background from picture to picture.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Freedom {
    /// Translation, rotation and scale: four parameters.
    #[default]
    Similarity,
    /// Affine transform: six parameters.
    Affine,
    /// Homography: eight parameters.
    Homography,
}

/// `[sbs]`: statistical background subtraction (the paper's section 5). The horizon and the field of view are the camera's.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields, expecting = "a table")]
pub struct Sbs {
    /// Method that finds the motion of the camera.
    pub method: SbsMethod,
    /// Motion model of the background. A model with more parameters also fits to walkers.
    pub freedom: Freedom,
    /// Number of pictures from which the background is learned while the robot stands still at the start. With 0 it is not learned
    /// before the drive.
    pub training_frames: TrainingFrames,
    /// Number of standard deviations within which a pixel belongs to the background (k).
    pub k: Deviations,
    /// Factor by which the residuals of the motion enlarge the region that a pixel is compared with (β of eq. 8).
    pub beta: CovarianceFactor,
    /// Size of that region, as a squared Mahalanobis distance (ħ of eq. 6).
    pub h_bar: RegionBound,
    /// Smallest area of a blob, in a picture of 160 px width. It grows with the square of the width.
    pub min_area_px: BlobArea,
    /// Number of pictures after which an object that has stopped becomes background.
    pub takeover_frames: Takeover,
    /// Number of pictures after which an object that has stopped becomes background where the picture does not change at all.
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
