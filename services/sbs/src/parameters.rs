//! What can be set.

use crate::background::BackgroundRule;
use crate::blobs::BlobRule;
use crate::local::LocalRule;
use crate::shadow::ShadowRule;
use crate::transform::Class;

/// How T is found.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Method {
    /// Robust direct Gauss–Newton.
    #[default]
    Direct,
    /// The paper's way: landmarks, iterative closest point and least squares.
    Icp,
}

/// All parameters of SBS.
#[derive(Debug, Clone, PartialEq)]
pub struct Parameters {
    /// How T is found.
    pub method: Method,
    /// Freedom of T.
    pub class: Class,
    /// Row of the horizon as a share of the height: shadow is looked for below it. 0 for a camera that looks down, 1: no shadow.
    pub horizon: f32,
    /// Horizontal field of view, rad: turns odometry into a first guess of T.
    pub field_of_view_rad: f64,
    /// Frames of training while the robot stands still; 0: none.
    pub training_frames: usize,
    /// The local field.
    pub local: LocalRule,
    /// The background update.
    pub background: BackgroundRule,
    /// Where shadow is looked for.
    pub shadow: ShadowRule,
    /// What is a blob.
    pub blobs: BlobRule,
    /// The model is resampled once the displacement exceeds this (root mean square over the picture), px.
    pub resample_px: f32,
    /// A compensated frame difference below this, grey levels, is still.
    pub still_level: f32,
    /// β of eq. 8.
    pub beta: f64,
    /// ħ of eq. 6.
    pub h_bar: f64,
}

impl Default for Parameters {
    fn default() -> Self {
        Self {
            method: Method::Direct,
            class: Class::Similarity,
            horizon: 0.5,
            field_of_view_rad: 70.0_f64.to_radians(),
            training_frames: 15,
            local: LocalRule::default(),
            background: BackgroundRule::default(),
            shadow: ShadowRule::default(),
            blobs: BlobRule::default(),
            resample_px: 0.3,
            still_level: 6.0,
            beta: 0.25,
            h_bar: 4.0,
        }
    }
}
