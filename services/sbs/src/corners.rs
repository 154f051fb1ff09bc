//! Landmarks: corners of the picture with the patch around them.

use crate::plane::Plane;
use crate::pyramid::Level;

/// Half the edge of a patch, px.
const PATCH: usize = 3;
/// Pixels of a patch.
const PATCH_PIXELS: usize = (2 * PATCH + 1) * (2 * PATCH + 1);
/// One corner is kept in each block of this edge, px.
const BLOCK: usize = 6;
/// Smallest eigenvalue of the mean structure tensor that makes a corner, (grey levels a pixel)².
const STRENGTH_MIN: f32 = 4.0;

/// A corner, to a part of a pixel.
#[derive(Debug, Clone)]
pub(crate) struct Corner {
    pub(crate) place: [f64; 2],
    /// Its patch, of mean 0 and length 1.
    patch: [f32; PATCH_PIXELS],
}

impl Corner {
    /// Normalised correlation of two patches, −1 to 1.
    pub(crate) fn correlation(&self, other: &Self) -> f32 {
        self.patch.iter().zip(&other.patch).map(|(a, b)| a * b).sum()
    }
}

/// The strongest corner of each block (smallest eigenvalue of the structure tensor, Shi and Tomasi), away from `moving`.
pub(crate) fn corners(level: &Level, moving: &Plane<u8>) -> Vec<Corner> {
    let strength = strength(level);
    let (width, height) = (strength.width(), strength.height());
    let margin = PATCH + 1;
    let mut corners = Vec::new();
    for top in (margin..height.saturating_sub(margin)).step_by(BLOCK) {
        for left in (margin..width.saturating_sub(margin)).step_by(BLOCK) {
            let mut best = (STRENGTH_MIN, 0, 0);
            for v in top..(top + BLOCK).min(height - margin) {
                for (u, &s) in strength.row(v).iter().enumerate().take((left + BLOCK).min(width - margin)).skip(left) {
                    if s > best.0 {
                        best = (s, u, v);
                    }
                }
            }
            let (s, u, v) = best;
            let peak = s > STRENGTH_MIN && (0..9).all(|n| strength.nearest((u + n % 3) as isize - 1, (v + n / 3) as isize - 1) <= s);
            if peak && moving.nearest(u as isize, v as isize) == 0 {
                let patch = patch(&level.image, u, v);
                corners.extend(patch.map(|patch| Corner { place: refined(&strength, u, v), patch }));
            }
        }
    }
    corners
}

/// The smallest eigenvalue of the structure tensor, mean over 5 × 5.
fn strength(level: &Level) -> Plane<f32> {
    let (width, height) = (level.image.width(), level.image.height());
    let mut out = Plane::filled(width, height, 0.0);
    for v in 2..height.saturating_sub(2) {
        for u in 2..width.saturating_sub(2) {
            let (mut uu, mut uv, mut vv) = (0.0_f32, 0.0, 0.0);
            for row in v - 2..=v + 2 {
                let gradients = level.gradient_u.row(row)[u - 2..=u + 2].iter().zip(&level.gradient_v.row(row)[u - 2..=u + 2]);
                for (&gu, &gv) in gradients {
                    uu += gu * gu;
                    uv += gu * gv;
                    vv += gv * gv;
                }
            }
            let (half, difference) = (0.5 * (uu + vv), 0.5 * (uu - vv));
            out.row_mut(v)[u] = (half - (difference * difference + uv * uv).sqrt()) / 25.0;
        }
    }
    out
}

/// The peak of the parabolas through the strengths of the pixel and its neighbours along each axis.
fn refined(strength: &Plane<f32>, u: usize, v: usize) -> [f64; 2] {
    let at = |du: isize, dv: isize| f64::from(strength.nearest(u as isize + du, v as isize + dv));
    let peak = |before: f64, here: f64, after: f64| {
        let bend = before - 2.0 * here + after;
        if bend < 0.0 { (0.5 * (before - after) / bend).clamp(-0.5, 0.5) } else { 0.0 }
    };
    [u as f64 + peak(at(-1, 0), at(0, 0), at(1, 0)), v as f64 + peak(at(0, -1), at(0, 0), at(0, 1))]
}

/// The patch around a pixel, of mean 0 and length 1; `None` for a flat one.
fn patch(image: &Plane<f32>, u: usize, v: usize) -> Option<[f32; PATCH_PIXELS]> {
    let mut patch = [0.0; PATCH_PIXELS];
    let rows = (v.checked_sub(PATCH)?..=v + PATCH).map(|row| image.row(row).get(u - PATCH.min(u)..=u + PATCH));
    for (out, row) in patch.chunks_mut(2 * PATCH + 1).zip(rows) {
        out.iter_mut().zip(row?).for_each(|(o, &z)| *o = z);
    }
    let mean = patch.iter().sum::<f32>() / PATCH_PIXELS as f32;
    patch.iter_mut().for_each(|z| *z -= mean);
    let length = patch.iter().map(|z| z * z).sum::<f32>().sqrt();
    (length > 1.0).then(|| patch.map(|z| z / length))
}
