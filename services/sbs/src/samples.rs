//! The pixels that say most about motion.

use crate::plane::Plane;
use crate::pyramid::{LEVELS, Level};

/// Pixels with a weaker gradient (grey levels a pixel) say nothing about motion but cost as much as the others.
pub(crate) const GRADIENT_MIN: f32 = 2.5;

/// A pixel of the current frame that takes part.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Sample {
    pub(crate) u: f32,
    pub(crate) v: f32,
    pub(crate) value: f32,
    pub(crate) gradient_u: f32,
    pub(crate) gradient_v: f32,
}

/// About this many samples a level, finest first: the coarse ones need only lead the way.
const ENOUGH: [usize; LEVELS] = [3600, 1200, 1200];

/// The pixel of the strongest gradient in each stretch of a row; stretches and the distance of rows are as large as leaves enough
/// of them. `moving` marks pixels of the base picture that take no part; the level is `k` halvings smaller.
pub(crate) fn strongest(level: &Level, k: usize, moving: &Plane<u8>) -> Vec<Sample> {
    let (width, height) = (level.image.width(), level.image.height());
    let enough = ENOUGH[k.min(LEVELS - 1)];
    let edge = ((width * height / enough) as f64).sqrt().round().max(1.0) as usize;
    let mut samples = Vec::with_capacity(enough * 2);
    let mut strength = vec![0.0_f32; width];
    for v in (edge / 2 + 1..height.saturating_sub(1)).step_by(edge) {
        let (row_u, row_v) = (level.gradient_u.row(v), level.gradient_v.row(v));
        for ((s, &gu), &gv) in strength.iter_mut().zip(row_u).zip(row_v) {
            *s = gu * gu + gv * gv;
        }
        for (stretch, strengths) in strength.chunks(edge).enumerate() {
            let mut best = (GRADIENT_MIN * GRADIENT_MIN, usize::MAX);
            for (i, &s) in strengths.iter().enumerate() {
                best = if s > best.0 { (s, i) } else { best };
            }
            let u = stretch * edge + best.1.min(edge);
            if best.1 == usize::MAX || moving.nearest((u << k) as isize, (v << k) as isize) != 0 {
                continue;
            }
            let value = level.image.row(v)[u];
            samples.push(Sample { u: u as f32, v: v as f32, value, gradient_u: row_u[u], gradient_v: row_v[u] });
        }
    }
    samples
}
