//! How well a transform explains the frame, and what its residuals are.

use crate::alignment::Covariance;
use crate::plane::Plane;
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
    /// The same, each sample counted by how well it agrees, 0 to 1: tells transforms apart that differ by parts of a pixel.
    pub(crate) support: f64,
    /// Σ̂ of the accepted pairs (eq. 9): a sample and its counterpart along its gradient.
    pub(crate) sigma: Covariance,
}

/// Compares the samples of the current frame with a picture at T x; a sample that leaves the picture has no say.
pub(crate) fn agreement(samples: &[Sample], reference: &Plane<f32>, gain: f32, transform: &Transform) -> Agreement {
    let (right, bottom) = ((reference.width() - 1) as f32, (reference.height() - 1) as f32);
    let m = transform.rows().map(|x| x as f32);
    let (mut all, mut agree) = (0_u32, 0_u32);
    let mut sum = [0.0_f32; 3];
    let mut support = 0.0_f32;
    // Every fourth one tells as much.
    for s in samples.iter().step_by(4) {
        let scale = 1.0 / (m[6] * s.u + m[7] * s.v + m[8]);
        let u = (m[0] * s.u + m[1] * s.v + m[2]) * scale;
        let v = (m[3] * s.u + m[4] * s.v + m[5]) * scale;
        if !(u >= 0.0 && v >= 0.0 && u <= right && v <= bottom) {
            continue;
        }
        all += 1;
        let e = s.value - gain * reference.bilinear_inside(u, v);
        let t = e / NOISE;
        support += 1.0 / (1.0 + t * t);
        let squared = s.gradient_u * s.gradient_u + s.gradient_v * s.gradient_v;
        if e.abs() > NOISE + SHIFT_PX * squared.sqrt() {
            continue;
        }
        agree += 1;
        let per_squared = e / squared;
        let (du, dv) = (per_squared * s.gradient_u, per_squared * s.gradient_v);
        sum = [sum[0] + du * du, sum[1] + du * dv, sum[2] + dv * dv];
    }
    let [uu, uv, vv] = sum.map(|x| f64::from(x) / f64::from(agree.max(1)));
    let all = f64::from(all.max(1));
    Agreement { inliers: f64::from(agree) / all, support: f64::from(support) / all, sigma: Covariance { uu, uv, vv } }
}
