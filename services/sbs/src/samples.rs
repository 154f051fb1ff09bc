//! The pixels that say most about motion.

use crate::plane::Plane;
use crate::pyramid::Level;

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

/// About this many samples of a level are enough for eight parameters.
const ENOUGH: usize = 1200;

/// The pixel of the strongest gradient in each block of a level; blocks are as large as leaves enough of them. `moving` marks
/// pixels of the base picture that take no part; the level is `k` halvings smaller.
pub(crate) fn strongest(level: &Level, k: usize, moving: &Plane<u8>) -> Vec<Sample> {
    let (width, height) = (level.image.width(), level.image.height());
    let edge = ((width * height / ENOUGH) as f64).sqrt().round().max(1.0) as usize;
    let mut samples = Vec::with_capacity(ENOUGH * 2);
    let mut strength = vec![0.0_f32; width];
    let mut best: Vec<(f32, usize, usize)> = vec![(0.0, 0, 0); width.div_ceil(edge)];
    for v in 1..height.saturating_sub(1) {
        let (row_u, row_v) = (level.gradient_u.row(v), level.gradient_v.row(v));
        for ((s, &gu), &gv) in strength.iter_mut().zip(row_u).zip(row_v) {
            *s = gu * gu + gv * gv;
        }
        let inner = 1..width.saturating_sub(1);
        for (u, &s) in strength.iter().enumerate().take(inner.end).skip(inner.start) {
            let b = &mut best[u / edge];
            if s > b.0 {
                *b = (s, u, v);
            }
        }
        if v % edge == edge - 1 || v + 2 == height {
            for b in &mut best {
                let (s, u, v) = std::mem::replace(b, (0.0, 0, 0));
                if s < GRADIENT_MIN * GRADIENT_MIN || moving.nearest((u << k) as isize, (v << k) as isize) != 0 {
                    continue;
                }
                let at = v * width + u;
                samples.push(Sample {
                    u: u as f32,
                    v: v as f32,
                    value: level.image.values()[at],
                    gradient_u: level.gradient_u.values()[at],
                    gradient_v: level.gradient_v.values()[at],
                });
            }
        }
    }
    samples
}
