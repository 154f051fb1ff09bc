//! Estimation of the local field from the previous frame and the model.

use crate::field::Field;
use crate::motion::{Motion, Places};
use crate::plane::Plane;
use crate::pyramid::Level;
use crate::samples::GRADIENT_MIN;

/// What the field is held to.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LocalRule {
    /// λ: how strongly neighbours agree, against the mean cell's normal equations.
    pub lambda: f32,
    /// μ: how strongly the field is pulled to zero, likewise.
    pub mu: f32,
    /// Largest displacement, px of the picture that motion is estimated in.
    pub reach_px: f32,
    /// Robust scale of the residuals in each step, grey levels.
    pub scales: [f32; 2],
    /// Share of the model in the picture that the current frame is compared with; the rest is the previous frame.
    pub model_share: f32,
}

impl Default for LocalRule {
    fn default() -> Self {
        Self { lambda: 0.2, mu: 0.02, reach_px: 3.0, scales: [6.0, 3.5], model_share: 0.6 }
    }
}

/// A pixel that takes part.
#[derive(Debug, Clone, Copy)]
struct Pixel {
    u: u32,
    value: f32,
    gradient_u: f32,
    gradient_v: f32,
}

/// Normal equations of one cell.
#[derive(Debug, Clone, Copy, Default)]
struct Cell {
    uu: f32,
    uv: f32,
    vv: f32,
    u: f32,
    v: f32,
}

/// The field that, added to T, best maps the current frame into a reference, from a start.
///
/// `reference` is in the brightness of the current frame; `moving` marks pixels that take no part.
pub(crate) fn estimate(current: &Level, reference: &Plane<f32>, moving: &Plane<u8>, start: Motion, rule: &LocalRule) -> Motion {
    let mut motion = start;
    let (pixels, ends) = pixels(current, moving);
    let mut cells = vec![Cell::default(); motion.field.cells().len()];
    for scale in rule.scales {
        cells.fill(Cell::default());
        accumulate(&pixels, &ends, reference, &motion, scale, &mut cells);
        solve(&cells, &mut motion.field, rule);
    }
    motion
}

/// Of each pair of neighbours in a row the one with the stronger gradient, if it says something, row by row, and where each row
/// ends: neighbours share most of what they know.
fn pixels(current: &Level, moving: &Plane<u8>) -> (Vec<Pixel>, Vec<usize>) {
    let (width, height) = (current.image.width(), current.image.height());
    let mut pixels = Vec::with_capacity(width * height / 3);
    let mut ends = Vec::with_capacity(height);
    let mut strength = vec![0.0_f32; width];
    for v in 0..height {
        let (image, row_u, row_v, out) = (current.image.row(v), current.gradient_u.row(v), current.gradient_v.row(v), moving.row(v));
        for ((s, &gu), &gv) in strength.iter_mut().zip(row_u).zip(row_v) {
            *s = gu * gu + gv * gv;
        }
        for (pair, s) in strength.chunks_exact(2).enumerate() {
            let u = 2 * pair + usize::from(s[1] > s[0]);
            if s[0].max(s[1]) >= GRADIENT_MIN * GRADIENT_MIN && out[u] == 0 {
                pixels.push(Pixel { u: u as u32, value: image[u], gradient_u: row_u[u], gradient_v: row_v[u] });
            }
        }
        ends.push(pixels.len());
    }
    (pixels, ends)
}

fn accumulate(pixels: &[Pixel], ends: &[usize], reference: &Plane<f32>, motion: &Motion, scale: f32, cells: &mut [Cell]) {
    let (width, height) = (reference.width(), reference.height());
    let (right, bottom) = ((width - 1) as f32, (height - 1) as f32);
    let (edge, columns) = (motion.field.cell(), motion.field.columns());
    let mut places = Places::default();
    let per_scale = 1.0 / scale;
    let mut first = 0;
    for (v, &end) in ends.iter().enumerate() {
        if first == end {
            continue;
        }
        motion.places(v, width, &mut places);
        let row = &mut cells[v / edge * columns..][..columns];
        for p in &pixels[first..end] {
            let (pu, pv) = (places.u[p.u as usize], places.v[p.u as usize]);
            if !(pu >= 0.0 && pv >= 0.0 && pu <= right && pv <= bottom) {
                continue;
            }
            let e = p.value - reference.bilinear_inside(pu, pv);
            let t = e * per_scale;
            let weight = 1.0 / ((1.0 + t * t) * (1.0 + t * t));
            let (wu, wv) = (weight * p.gradient_u, weight * p.gradient_v);
            let cell = &mut row[p.u as usize / edge];
            cell.uu += wu * p.gradient_u;
            cell.uv += wu * p.gradient_v;
            cell.vv += wv * p.gradient_v;
            cell.u += wu * e;
            cell.v += wv * e;
        }
        first = end;
    }
}

/// The equations of a cell with its ties to neighbours, solved for them: f = base + spread × (sum of neighbours).
#[derive(Debug, Clone, Copy)]
struct Tied {
    base: [f32; 2],
    spread: [f32; 3],
}

/// Smooths while it solves: data term + λ × differences of neighbours + μ × length, by Gauss–Seidel.
fn solve(cells: &[Cell], field: &mut Field, rule: &LocalRule) {
    const SWEEPS: usize = 8;
    let mean = cells.iter().map(|c| 0.5 * (c.uu + c.vv)).sum::<f32>() / cells.len() as f32;
    if !(mean > 0.0 && mean.is_finite()) {
        return;
    }
    let (columns, rows) = (field.columns(), field.rows());
    let (lambda, mu) = (rule.lambda * mean, rule.mu * mean);
    let neighbours = |column: usize, row: usize| {
        usize::from(column > 0) + usize::from(column + 1 < columns) + usize::from(row > 0) + usize::from(row + 1 < rows)
    };
    let tied = |(k, c): (usize, &Cell)| {
        // The data term is linear about the start s: A (f − s) = b.
        let s = field.cells()[k];
        let stay = lambda * neighbours(k % columns, k / columns) as f32 + mu;
        let (uu, vv) = (c.uu + stay, c.vv + stay);
        let per_determinant = 1.0 / (uu * vv - c.uv * c.uv);
        let (ru, rv) = (c.u + c.uu * s[0] + c.uv * s[1], c.v + c.uv * s[0] + c.vv * s[1]);
        Tied {
            base: [(ru * vv - rv * c.uv) * per_determinant, (rv * uu - ru * c.uv) * per_determinant],
            spread: [lambda * vv * per_determinant, -lambda * c.uv * per_determinant, lambda * uu * per_determinant],
        }
    };
    let tied: Vec<Tied> = cells.iter().enumerate().map(tied).collect();
    let now = field.cells_mut();
    for _ in 0..SWEEPS {
        for row in 0..rows {
            for column in 0..columns {
                let k = row * columns + column;
                let mut sum = [0.0_f32; 2];
                let mut add = |n: [f32; 2]| sum = [sum[0] + n[0], sum[1] + n[1]];
                if column > 0 {
                    add(now[k - 1]);
                }
                if column + 1 < columns {
                    add(now[k + 1]);
                }
                if row > 0 {
                    add(now[k - columns]);
                }
                if row + 1 < rows {
                    add(now[k + columns]);
                }
                let Tied { base, spread } = tied[k];
                now[k] = [base[0] + spread[0] * sum[0] + spread[1] * sum[1], base[1] + spread[1] * sum[0] + spread[2] * sum[1]];
            }
        }
    }
    for c in now {
        let length = (c[0] * c[0] + c[1] * c[1]).sqrt();
        if length > rule.reach_px {
            *c = [c[0] * rule.reach_px / length, c[1] * rule.reach_px / length];
        }
    }
}
