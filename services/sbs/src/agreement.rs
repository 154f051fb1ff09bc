//! How well a transform explains the frame, and what its residuals are.

use crate::alignment::Covariance;
use crate::plane::Plane;
use crate::resample::BETWEEN;
use crate::samples::{Compared, Samples, compare};
use crate::transform::Transform;

/// Sensor noise after smoothing, grey levels.
const NOISE: f32 = 4.0;
/// A residual that a shift of this many pixels along the gradient explains is agreement.
const SHIFT_PX: f32 = 0.5;

/// What the samples say about a transform.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Agreement {
    /// Share of the samples that agree; 0 without samples.
    pub(crate) inliers: f64,
    /// The same, each sample counted by how well it agrees, 0 to 1: tells transforms apart that differ by parts of a pixel.
    pub(crate) support: f64,
    /// Σ̂ of the accepted pairs (eq. 9): a sample and its counterpart along its gradient.
    pub(crate) sigma: Covariance,
}

/// Compares samples of the current frame with a picture at T x; a sample that leaves the picture has no say.
pub(crate) fn agreement(samples: &Samples, reference: &Plane<f32>, gain: f32, transform: &Transform) -> Agreement {
    let mut compared = Compared::default();
    compare(samples, reference, gain, transform.rows().map(|x| x as f32), &mut compared);
    let (mut all, mut agree) = (0_u32, 0_u32);
    let mut sum = [0.0_f32; 3];
    let mut support = 0.0_f32;
    let gradients = samples.gradient_u.iter().zip(&samples.gradient_v);
    for ((e, inside), (gradient_u, gradient_v)) in compared.residuals.iter().zip(compared.inside()).zip(gradients) {
        if *inside < BETWEEN {
            continue;
        }
        all += 1;
        let t = e / NOISE;
        support += 1.0 / (1.0 + t * t);
        let squared = gradient_u * gradient_u + gradient_v * gradient_v;
        if e.abs() > NOISE + SHIFT_PX * squared.sqrt() {
            continue;
        }
        agree += 1;
        let per_squared = e / squared;
        let (du, dv) = (per_squared * gradient_u, per_squared * gradient_v);
        sum = [sum[0] + du * du, sum[1] + du * dv, sum[2] + dv * dv];
    }
    let [uu, uv, vv] = sum.map(|x| f64::from(x) / f64::from(agree.max(1)));
    let all = f64::from(all.max(1));
    Agreement { inliers: f64::from(agree) / all, support: f64::from(support) / all, sigma: Covariance { uu, uv, vv } }
}
