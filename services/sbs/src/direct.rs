//! T without landmarks: robust direct Gauss–Newton on a pyramid, current frame against the previous one.

use nalgebra::{Matrix3, SMatrix, SVector};

use crate::order;
use crate::plane::Plane;
use crate::pyramid::{LEVELS, Level, Pyramid};
use crate::samples::{Sample, strongest};
use crate::transform::{Class, Transform};

/// Most Gauss–Newton steps on each level, finest first.
const STEPS: [usize; LEVELS] = [1, 3, 5];
/// A step that moves the level's corners by less, px, is the last.
const STEP_MIN_PX: f64 = 0.02;

/// The transform of a class that best maps the current frame into the previous one, from a start nearby.
///
/// `moving` marks pixels that take no part, `base_samples` are those of the finest level that do; `gain` is the brightness of the current frame over the previous one.
pub(crate) fn estimate(
    current: &Pyramid,
    previous: &Pyramid,
    moving: &Plane<u8>,
    base_samples: &[Sample],
    gain: f32,
    class: Class,
    start: Transform,
) -> Option<Transform> {
    let mut transform = start.scaled(0.5_f64.powi(LEVELS as i32 - 1))?;
    for k in (0..LEVELS).rev() {
        let coarse = if k == 0 { Vec::new() } else { strongest(&current.levels[k], k, moving) };
        let samples = if k == 0 { base_samples } else { &coarse[..] };
        for _ in 0..STEPS[k] {
            let Some((next, moved)) = step(samples, &previous.levels[k], gain, class, &transform) else { break };
            transform = next;
            if moved < STEP_MIN_PX {
                break;
            }
        }
        if k > 0 {
            transform = transform.scaled(2.0)?;
        }
    }
    Some(transform)
}

/// One step of inverse composition: the gradient is the current frame's, so only the residual changes. Gives the new transform
/// and how far it moved a corner of the samples' level, px.
fn step(samples: &[Sample], previous: &Level, gain: f32, class: Class, transform: &Transform) -> Option<(Transform, f64)> {
    let (width, height) = (previous.image.width(), previous.image.height());
    let residuals = residuals(samples, previous, gain, transform);
    let mut sizes: Vec<f32> = residuals.iter().step_by(4).filter(|e| e.is_finite()).map(|e| e.abs()).collect();
    // 1.4826 turns the median absolute residual of a Gaussian into its σ; noise is never taken as below a grey level.
    let scale = 2.5 * (1.4826 * order::select(&mut sizes, 0.5)?).max(1.0);
    let (centre_u, centre_v, unit) = (0.5 * width as f32, 0.5 * height as f32, 2.0 / width as f32);
    let p = match class {
        Class::Translation => solve::<2>(samples, &residuals, scale, |s| [s.gradient_u, s.gradient_v]),
        Class::Similarity => solve::<4>(samples, &residuals, scale, |s| {
            let (x, y) = ((s.u - centre_u) * unit, (s.v - centre_v) * unit);
            [s.gradient_u, s.gradient_v, s.gradient_u * x + s.gradient_v * y, s.gradient_v * x - s.gradient_u * y]
        }),
        Class::Affine => solve::<6>(samples, &residuals, scale, |s| {
            let (x, y) = ((s.u - centre_u) * unit, (s.v - centre_v) * unit);
            let (gu, gv) = (s.gradient_u, s.gradient_v);
            [gu, gv, gu * x, gu * y, gv * x, gv * y]
        }),
        Class::Homography => solve::<8>(samples, &residuals, scale, |s| {
            let (x, y) = ((s.u - centre_u) * unit, (s.v - centre_v) * unit);
            let (gu, gv) = (s.gradient_u, s.gradient_v);
            let along = gu * x + gv * y;
            [gu, gv, gu * x, gu * y, gv * x, gv * y, -x * along, -y * along]
        }),
    }?;
    let increment = increment(class, &p, f64::from(centre_u), f64::from(centre_v), f64::from(unit))?;
    let moved = increment.corner_motion(width, height);
    Some((transform.after(&increment.inverse()?)?, moved))
}

/// Previous frame at T x, in the current brightness, less the current frame at x; NaN outside.
fn residuals(samples: &[Sample], previous: &Level, gain: f32, transform: &Transform) -> Vec<f32> {
    let m = transform.rows().map(|x| x as f32);
    let (right, bottom) = ((previous.image.width() - 1) as f32, (previous.image.height() - 1) as f32);
    let at = |s: &Sample| {
        let scale = 1.0 / (m[6] * s.u + m[7] * s.v + m[8]);
        let u = (m[0] * s.u + m[1] * s.v + m[2]) * scale;
        let v = (m[3] * s.u + m[4] * s.v + m[5]) * scale;
        if u >= 0.0 && v >= 0.0 && u <= right && v <= bottom { gain * previous.image.bilinear_inside(u, v) - s.value } else { f32::NAN }
    };
    samples.iter().map(at).collect()
}

/// The weighted normal equations of N parameters, solved; unused parameters are zero.
fn solve<const N: usize>(
    samples: &[Sample],
    residuals: &[f32],
    scale: f32,
    jacobian: impl Fn(&Sample) -> [f32; N],
) -> Option<SVector<f64, 8>> {
    let mut left = [[0.0_f32; N]; N];
    let mut right = [0.0_f32; N];
    for (sample, &e) in samples.iter().zip(residuals) {
        if !e.is_finite() {
            continue;
        }
        let t = e / scale;
        let weight = 1.0 / ((1.0 + t * t) * (1.0 + t * t));
        let j = jacobian(sample);
        for a in 0..N {
            let wa = weight * j[a];
            right[a] += wa * e;
            for b in 0..N {
                left[a][b] += wa * j[b];
            }
        }
    }
    let matrix = SMatrix::<f64, N, N>::from_fn(|a, b| f64::from(left[a][b]));
    let solution = matrix.cholesky()?.solve(&SVector::<f64, N>::from_fn(|a, _| f64::from(right[a])));
    Some(SVector::from_fn(|a, _| solution.as_slice().get(a).copied().unwrap_or(0.0)))
}

/// The small transform of a step's parameters, which count shifts in pixels and places in half widths from the centre.
fn increment(class: Class, p: &SVector<f64, 8>, centre_u: f64, centre_v: f64, unit: f64) -> Option<Transform> {
    let (a, b, c, d, e, f) = match class {
        Class::Translation => (0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
        Class::Similarity => (p[2], -p[3], p[3], p[2], 0.0, 0.0),
        Class::Affine => (p[2], p[3], p[4], p[5], 0.0, 0.0),
        Class::Homography => (p[2], p[3], p[4], p[5], p[6], p[7]),
    };
    let to_unit = Matrix3::new(unit, 0.0, -unit * centre_u, 0.0, unit, -unit * centre_v, 0.0, 0.0, 1.0);
    let warp = Matrix3::new(1.0 + unit * a, unit * b, unit * p[0], unit * c, 1.0 + unit * d, unit * p[1], unit * e, unit * f, 1.0);
    Transform::from_matrix(to_unit.try_inverse()? * warp * to_unit)
}
