//! T from pairs by least-square estimation (LSE, section 5.1 of the paper).

use nalgebra::{Matrix3, SMatrix, SVector};

use crate::alignment::Pair;
use crate::transform::{Class, Transform};

/// The transform of a class that maps the pairs' frame places onto their background places with least squares, residuals
/// measured in the background frame. `None` for too few pairs, or pairs that leave a parameter open (all on a line, or one point).
///
/// The homography is the linear solution with its last element 1, in coordinates centred on their mean and scaled to a mean
/// distance of √2 (Hartley).
#[must_use]
pub fn least_squares(class: Class, pairs: &[Pair]) -> Option<Transform> {
    if pairs.len() * 2 < class.parameters() || pairs.is_empty() {
        return None;
    }
    let to_frame = normaliser(pairs.iter().map(|p| p.frame))?;
    let to_background = if class == Class::Translation { to_frame } else { normaliser(pairs.iter().map(|p| p.background))? };
    let mut equations = Normal::default();
    for pair in pairs {
        let ([x, y], [u, v]) = (to_frame.apply(pair.frame), to_background.apply(pair.background));
        let (row_u, row_v, target) = rows(class, [x, y], [u, v]);
        equations.add(&row_u, target[0]);
        equations.add(&row_v, target[1]);
    }
    let normalised = matrix(class, &equations.solve(class.parameters())?)?;
    let there = normalised.after(&to_frame)?;
    to_background.inverse()?.after(&there)
}

/// Normal equations of up to eight unknowns.
struct Normal {
    left: SMatrix<f64, 8, 8>,
    right: SVector<f64, 8>,
}

impl Default for Normal {
    fn default() -> Self {
        Self { left: SMatrix::zeros(), right: SVector::zeros() }
    }
}

impl Normal {
    fn add(&mut self, row: &[f64; 8], target: f64) {
        let row = SVector::<f64, 8>::from(*row);
        self.left += row * row.transpose();
        self.right += row * target;
    }

    fn solve(&self, unknowns: usize) -> Option<SVector<f64, 8>> {
        let mut left = self.left;
        for k in unknowns..8 {
            left[(k, k)] = 1.0;
        }
        let factor = left.cholesky()?;
        // A pivot this small against the largest leaves a parameter open.
        let pivots = factor.l_dirty().diagonal();
        (pivots.min() > 1e-7 * pivots.max()).then(|| factor.solve(&self.right))
    }
}

fn rows(class: Class, [x, y]: [f64; 2], [u, v]: [f64; 2]) -> ([f64; 8], [f64; 8], [f64; 2]) {
    match class {
        Class::Translation => ([1., 0., 0., 0., 0., 0., 0., 0.], [0., 1., 0., 0., 0., 0., 0., 0.], [u - x, v - y]),
        Class::Similarity => ([x, -y, 1., 0., 0., 0., 0., 0.], [y, x, 0., 1., 0., 0., 0., 0.], [u, v]),
        Class::Affine => ([x, y, 1., 0., 0., 0., 0., 0.], [0., 0., 0., x, y, 1., 0., 0.], [u, v]),
        Class::Homography => ([x, y, 1., 0., 0., 0., -u * x, -u * y], [0., 0., 0., x, y, 1., -v * x, -v * y], [u, v]),
    }
}

fn matrix(class: Class, p: &SVector<f64, 8>) -> Option<Transform> {
    let m = match class {
        Class::Translation => Matrix3::new(1., 0., p[0], 0., 1., p[1], 0., 0., 1.),
        Class::Similarity => Matrix3::new(p[0], -p[1], p[2], p[1], p[0], p[3], 0., 0., 1.),
        Class::Affine => Matrix3::new(p[0], p[1], p[2], p[3], p[4], p[5], 0., 0., 1.),
        Class::Homography => Matrix3::new(p[0], p[1], p[2], p[3], p[4], p[5], p[6], p[7], 1.),
    };
    Transform::from_matrix(m)
}

/// Centres places on their mean and scales them to a mean distance of √2; `None` when they coincide.
fn normaliser(places: impl Iterator<Item = [f64; 2]> + Clone) -> Option<Transform> {
    let count = places.clone().count() as f64;
    let (su, sv) = places.clone().fold((0.0, 0.0), |(u, v), p| (u + p[0], v + p[1]));
    let (mu, mv) = (su / count, sv / count);
    let distance = places.map(|p| (p[0] - mu).hypot(p[1] - mv)).sum::<f64>() / count;
    let scale = if distance > 1e-9 { std::f64::consts::SQRT_2 / distance } else { 1.0 };
    Transform::new([scale, 0.0, -scale * mu, 0.0, scale, -scale * mv, 0.0, 0.0, 1.0])
}
