//! T without landmarks: robust direct Gauss–Newton on a pyramid, current frame against the previous one.

use nalgebra::{Matrix3, SMatrix, SVector};
use wide::f32x8;

use crate::frames::Frames;
use crate::order;
use crate::plane::Plane;
use crate::pyramid::LEVELS;
use crate::resample::BETWEEN;
use crate::samples::{Compared, Samples, compare, strongest};
use crate::transform::{Class, Transform};
use crate::vectorised::vectorised;

/// Most Gauss–Newton steps on each level, finest first.
const STEPS: [usize; LEVELS] = [1, 3, 5];
/// The same on the finest level where no coarse one led the way to it.
const STEPS_ALONE: usize = 3;
/// A step that moves the level's corners by less, px, is the last.
const STEP_MIN_PX: f64 = 0.02;

/// The transform of a class that best maps the current frame into the previous one, from a start nearby.
///
/// The search begins on level `coarsest`: 0 for a start that is all but right. `moving` marks pixels that take no part,
/// `base_samples` are those of the finest level that do; `gain` is the brightness of the current frame over the previous one.
pub(crate) fn estimate(
    Frames { current, previous, moving, gain }: &Frames<'_>,
    base_samples: &Samples,
    class: Class,
    start: Transform,
    coarsest: usize,
) -> Option<Transform> {
    let coarsest = coarsest.min(LEVELS - 1);
    let mut transform = start.scaled(0.5_f64.powi(coarsest as i32))?;
    let mut memory = Memory::default();
    for k in (0..=coarsest).rev() {
        let coarse = (k > 0).then(|| strongest(&current.levels[k], k, moving));
        let task = Task::new(coarse.as_ref().unwrap_or(base_samples), &previous.levels[k].image, *gain, class);
        let steps = if coarsest == 0 { STEPS_ALONE } else { STEPS[k] };
        for _ in 0..steps {
            let Some((next, moved)) = task.step(&transform, &mut memory) else { break };
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

/// What does not change from step to step on a level.
struct Task<'a> {
    samples: &'a Samples,
    /// How each parameter changes the value of each sample.
    jacobian: Vec<Vec<f32>>,
    previous: &'a Plane<f32>,
    gain: f32,
    class: Class,
}

/// Memory for a step.
#[derive(Default)]
struct Memory {
    compared: Compared,
    weights: Vec<f32>,
}

impl<'a> Task<'a> {
    fn new(samples: &'a Samples, previous: &'a Plane<f32>, gain: f32, class: Class) -> Self {
        let mut jacobian = vec![vec![0.0; samples.value.len()]; class.parameters()];
        let (centre_u, centre_v, unit) = frame(previous);
        let of = samples.at.u.iter().zip(&samples.at.v).zip(samples.gradient_u.iter().zip(&samples.gradient_v));
        for (n, ((u, v), (&gu, &gv))) in of.enumerate() {
            let (x, y) = ((u - centre_u) * unit, (v - centre_v) * unit);
            let along = gu * x + gv * y;
            let row: &[f32] = match class {
                Class::Translation => &[gu, gv],
                Class::Similarity => &[gu, gv, along, gv * x - gu * y],
                Class::Affine => &[gu, gv, gu * x, gu * y, gv * x, gv * y],
                Class::Homography => &[gu, gv, gu * x, gu * y, gv * x, gv * y, -x * along, -y * along],
            };
            for (column, &value) in jacobian.iter_mut().zip(row) {
                column[n] = value;
            }
        }
        Self { samples, jacobian, previous, gain, class }
    }

    /// One step of inverse composition: the gradient is the current frame's, so only the residual changes. Gives the new transform
    /// and how far it moved a corner of the samples' level, px.
    fn step(&self, transform: &Transform, memory: &mut Memory) -> Option<(Transform, f64)> {
        compare(self.samples, self.previous, self.gain, transform.rows().map(|x| x as f32), &mut memory.compared);
        let known = memory.compared.residuals.iter().zip(memory.compared.inside()).step_by(4).filter(|(_, inside)| **inside >= BETWEEN);
        let mut sizes: Vec<f32> = known.map(|(e, _)| e.abs()).collect();
        // 1.4826 turns the median absolute residual of a Gaussian into its σ; noise is never taken as below a grey level.
        let scale = 2.5 * (1.4826 * order::select(&mut sizes, 0.5)?).max(1.0);
        weigh(scale, memory);
        let p = self.solve(memory)?;
        let (centre_u, centre_v, unit) = frame(self.previous);
        let increment = increment(self.class, &p, f64::from(centre_u), f64::from(centre_v), f64::from(unit))?;
        let moved = increment.corner_motion(self.previous.width(), self.previous.height());
        Some((transform.after(&increment.inverse()?)?, moved))
    }

    /// The weighted normal equations, solved; unused parameters are zero.
    fn solve(&self, memory: &Memory) -> Option<SVector<f64, 8>> {
        let (mut left, mut right) = (SMatrix::<f64, 8, 8>::identity(), SVector::<f64, 8>::zeros());
        for (a, column) in self.jacobian.iter().enumerate() {
            right[a] = f64::from(sum_of_products(&memory.weights, column, &memory.compared.residuals));
            for (b, other) in self.jacobian.iter().enumerate().take(a + 1) {
                left[(a, b)] = f64::from(sum_of_products(&memory.weights, column, other));
                left[(b, a)] = left[(a, b)];
            }
        }
        Some(left.cholesky()?.solve(&right))
    }
}

/// Centre of a picture and one over half its width: parameters count places in half widths from the centre.
fn frame(picture: &Plane<f32>) -> (f32, f32, f32) {
    (0.5 * picture.width() as f32, 0.5 * picture.height() as f32, 2.0 / picture.width() as f32)
}

vectorised! {
    /// How much each sample counts: less with a larger residual, nothing outside the picture.
    fn weigh(scale: f32, memory: &mut Memory) {
        let Memory { compared, weights } = memory;
        weights.resize(compared.residuals.len(), 0.0);
        for ((weight, e), inside) in weights.iter_mut().zip(&compared.residuals).zip(compared.inside()) {
            let t = *e / scale;
            let w = 1.0 / ((1.0 + t * t) * (1.0 + t * t));
            *weight = if *inside >= BETWEEN { w } else { 0.0 };
        }
    }
}

vectorised! {
    /// Σ a b c, eight at a time.
    fn sum_of_products(a: &[f32], b: &[f32], c: &[f32]) -> f32 {
        let ((a, last_a), (b, last_b), (c, last_c)) = (a.as_chunks::<8>(), b.as_chunks::<8>(), c.as_chunks::<8>());
        let mut sums = f32x8::ZERO;
        for ((a, b), c) in a.iter().zip(b).zip(c) {
            sums += f32x8::new(*a) * f32x8::new(*b) * f32x8::new(*c);
        }
        let rest: f32 = last_a.iter().zip(last_b).zip(last_c).map(|((a, b), c)| a * b * c).sum();
        sums.to_array().iter().sum::<f32>() + rest
    }
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
