//! How well a transform explains the frame, and what its residuals are.

use crate::alignment::Covariance;
use crate::pyramid::Level;
use crate::samples::Sample;
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
    /// Σ̂ of the accepted pairs (eq. 9): a sample and its counterpart along its gradient.
    pub(crate) sigma: Covariance,
}

/// Compares the samples of the current frame with the previous one at T x; a sample that leaves the picture has no say.
pub(crate) fn agreement(samples: &[Sample], previous: &Level, gain: f32, transform: &Transform) -> Agreement {
    let (right, bottom) = ((previous.image.width() - 1) as f64, (previous.image.height() - 1) as f64);
    let (mut all, mut agree) = (0_u32, 0_u32);
    let mut sum = Covariance { uu: 0.0, uv: 0.0, vv: 0.0 };
    for s in samples {
        let [u, v] = transform.apply([f64::from(s.u), f64::from(s.v)]);
        if !(u >= 0.0 && v >= 0.0 && u <= right && v <= bottom) {
            continue;
        }
        all += 1;
        let e = s.value - gain * previous.image.bilinear(u as f32, v as f32);
        let squared = s.gradient_u * s.gradient_u + s.gradient_v * s.gradient_v;
        if e.abs() > NOISE + SHIFT_PX * squared.sqrt() {
            continue;
        }
        agree += 1;
        let (du, dv) = (f64::from(e * s.gradient_u / squared), f64::from(e * s.gradient_v / squared));
        sum = Covariance { uu: sum.uu + du * du, uv: sum.uv + du * dv, vv: sum.vv + dv * dv };
    }
    Agreement { inliers: f64::from(agree) / f64::from(all.max(1)), sigma: sum.times(1.0 / f64::from(agree.max(1))) }
}
