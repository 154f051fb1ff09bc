//! Motion compensation: from two frames to the way between them.

use crate::agreement::{Agreement, agreement};
use crate::direct;
use crate::frames::Frames;
use crate::icp;
use crate::order;
use crate::parameters::{Method, Parameters};
use crate::plane::Plane;
use crate::pyramid::LEVELS;
use crate::samples::strongest;
use crate::transform::Transform;

/// Fewer inliers than this: not compensated.
const INLIERS_MIN: f64 = 0.3;
/// A corner that moves more than this share of the width: not compensated.
const CORNER_MAX: f64 = 0.25;
/// An alternative must win by this much support against the simpler one before it.
const WIN: f64 = 0.005;

/// With this share of inliers a guess needs no coarse levels to lead it on.
const NEAR: f64 = 0.9;
/// One in so many samples tells how well a transform agrees.
pub(crate) const THINNED: usize = 2;

/// T with what speaks for it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Found {
    pub(crate) transform: Transform,
    pub(crate) agreement: Agreement,
}

impl Found {
    /// The same in a picture `factor` times as large.
    pub(crate) fn scaled(&self, factor: usize) -> Self {
        let factor = factor as f64;
        let sigma = self.agreement.sigma.times(factor * factor);
        Self { transform: self.transform.scaled(factor).unwrap_or(self.transform), agreement: Agreement { sigma, ..self.agreement } }
    }
}

/// Of identity, odometry, prediction and estimate the one with the most inliers, and whether it may be is_plausible.
pub(crate) fn transform(frames: &Frames<'_>, prediction: Transform, odometry: Option<Transform>, parameters: &Parameters) -> (Found, bool) {
    let samples = strongest(frames.current.base(), 0, frames.moving);
    let few = samples.thinned(THINNED);
    let judge =
        |transform: Transform| Found { transform, agreement: agreement(&few, &frames.previous.base().image, frames.gain, &transform) };
    let mut best = judge(Transform::identity());
    for guess in [odometry, Some(prediction)].into_iter().flatten() {
        if guess != best.transform {
            best = better(best, judge(guess));
        }
    }
    let estimate = match parameters.method {
        Method::Direct => {
            let coarsest = if best.agreement.inliers >= NEAR { 0 } else { LEVELS - 1 };
            direct::estimate(frames, &samples, parameters.class, best.transform, coarsest)
        }
        Method::Icp => icp::estimate(frames.current.base(), frames.previous.base(), frames.moving, parameters.class, best.transform),
    };
    if let Some(estimate) = estimate {
        best = better(best, judge(estimate));
    }
    let image = &frames.current.base().image;
    let (width, height) = (image.width(), image.height());
    let is_plausible = best.agreement.inliers >= INLIERS_MIN && best.transform.corner_motion(width, height) <= CORNER_MAX * width as f64;
    (best, is_plausible)
}

fn better(simple: Found, other: Found) -> Found {
    if other.agreement.support > simple.agreement.support + WIN { other } else { simple }
}

/// The brightness of one picture over another: the median ratio of pixels that take part.
pub(crate) fn gain(current: &Plane<f32>, reference: &Plane<f32>, moving: &Plane<u8>) -> f32 {
    // A prime stride visits all columns.
    let stride = (current.values().len() / 800).max(1) | 1;
    let ratio = |((&c, &r), &m): ((&f32, &f32), &u8)| (r > 16.0 && m == 0).then_some(c / r);
    let mut ratios: Vec<f32> =
        current.values().iter().zip(reference.values()).zip(moving.values()).step_by(stride).filter_map(ratio).collect();
    order::select(&mut ratios, 0.5).unwrap_or(1.0).clamp(0.5, 2.0)
}

/// What the robot's turn between two frames makes of the picture: a shift of the base picture, for a focal length in its pixels.
///
/// Turning left (yaw grows) the scene moves right, and T points back.
pub(crate) fn turned(yaw_change_rad: f64, focal_px: f64) -> Option<Transform> {
    let shift = focal_px * yaw_change_rad.tan();
    Transform::new([1.0, 0.0, -shift, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0])
}

/// The picture that the local field compares with: the model where the last resampling left it, mixed with the previous frame,
/// both in the brightness of the current one.
pub(crate) fn reference(previous: &Plane<f32>, gain_previous: f32, model: &Plane<f32>, gain_model: f32, share: f32) -> Plane<f32> {
    let (a, b) = ((1.0 - share) * gain_previous, share * gain_model);
    let mut out = previous.clone();
    for (o, m) in out.values_mut().iter_mut().zip(model.values()) {
        *o = a * *o + b * m;
    }
    out
}
