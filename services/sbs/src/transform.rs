//! T: from a pixel of the current frame to the background frame, homogeneous, `α x̂ = T x`.

use nalgebra::{Matrix3, Vector3};

/// How much freedom T has.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Class {
    /// Two parameters: a shift.
    Translation,
    /// Four: shift, turn and scale. More freedom fits the walkers (F1 driving .758 / .695 / .666 for this and the next two).
    #[default]
    Similarity,
    /// Six.
    Affine,
    /// Eight.
    Homography,
}

impl Class {
    /// Number of parameters.
    #[must_use]
    pub fn parameters(self) -> usize {
        match self {
            Self::Translation => 2,
            Self::Similarity => 4,
            Self::Affine => 6,
            Self::Homography => 8,
        }
    }
}

/// A transform of the image plane, kept with its last element 1.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Transform(Matrix3<f64>);

impl Default for Transform {
    fn default() -> Self {
        Self::identity()
    }
}

impl Transform {
    /// Nothing moves.
    #[must_use]
    pub fn identity() -> Self {
        Self(Matrix3::identity())
    }

    /// A transform of nine numbers, row by row; `None` when one is no number, the last is 0 or it has no inverse.
    #[must_use]
    pub fn new(rows: [f64; 9]) -> Option<Self> {
        Self::from_matrix(Matrix3::from_row_slice(&rows))
    }

    pub(crate) fn from_matrix(matrix: Matrix3<f64>) -> Option<Self> {
        let scaled = matrix / matrix[(2, 2)];
        (scaled.iter().all(|m| m.is_finite()) && scaled.determinant().abs() > 1e-9).then_some(Self(scaled))
    }

    /// Row by row.
    #[must_use]
    pub fn rows(&self) -> [f64; 9] {
        let m = &self.0;
        [m[(0, 0)], m[(0, 1)], m[(0, 2)], m[(1, 0)], m[(1, 1)], m[(1, 2)], m[(2, 0)], m[(2, 1)], m[(2, 2)]]
    }

    /// Where a pixel of the current frame lies in the background frame, px.
    #[must_use]
    pub fn apply(&self, [u, v]: [f64; 2]) -> [f64; 2] {
        let x = self.0 * Vector3::new(u, v, 1.0);
        [x[0] / x[2], x[1] / x[2]]
    }

    /// Whether parallels stay parallel.
    #[must_use]
    pub fn is_affine(&self) -> bool {
        self.0[(2, 0)].abs().max(self.0[(2, 1)].abs()) < 1e-12
    }

    /// First `other`, then this one; `None` when the product maps the origin to infinity.
    #[must_use]
    pub fn after(&self, other: &Self) -> Option<Self> {
        Self::from_matrix(self.0 * other.0)
    }

    /// The way back.
    #[must_use]
    pub fn inverse(&self) -> Option<Self> {
        Self::from_matrix(self.0.try_inverse()?)
    }

    /// The furthest that a corner of a picture moves, px.
    #[must_use]
    pub fn corner_motion(&self, width: usize, height: usize) -> f64 {
        let (w, h) = (width.saturating_sub(1) as f64, height.saturating_sub(1) as f64);
        let moved = |corner: [f64; 2]| {
            let [u, v] = self.apply(corner);
            (u - corner[0]).hypot(v - corner[1])
        };
        // `max` passes NaN over: a corner at infinity must not.
        [[0.0, 0.0], [w, 0.0], [0.0, h], [w, h]].map(moved).into_iter().fold(0.0, |a, b| if b > a || b.is_nan() { b } else { a })
    }

    /// The same motion in a picture `factor` times as large, pixel centres at whole numbers.
    #[must_use]
    pub fn scaled(&self, factor: f64) -> Option<Self> {
        // Pixel i of the small picture covers the large one's pixels f i to f i + f − 1.
        let shift = (factor - 1.0) / 2.0;
        let large_from_small = Matrix3::new(factor, 0.0, shift, 0.0, factor, shift, 0.0, 0.0, 1.0);
        Self::from_matrix(large_from_small * self.0 * large_from_small.try_inverse()?)
    }
}
