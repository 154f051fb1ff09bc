//! Estimation of the local field from the previous frame and the model.

use crate::field::Field;
use crate::motion::{Motion, Places};
use crate::plane::Plane;
use crate::pyramid::Level;
use crate::resample::{BETWEEN, Grid};
use crate::samples::GRADIENT_MIN;
use crate::vectorised::vectorised;

/// What the field is held to.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LocalRule {
    /// λ: how strongly neighbours agree, against the mean cell's normal equations.
    pub lambda: f32,
    /// μ: how strongly the field is pulled to zero, likewise.
    pub mu: f32,
    /// Largest displacement, px of the picture that motion is estimated in.
    pub reach_px: f32,
    /// Robust scale of the residuals, grey levels.
    pub scale: f32,
    /// Share of the model in the picture that the current frame is compared with; the rest is the previous frame.
    pub model_share: f32,
}

impl Default for LocalRule {
    fn default() -> Self {
        Self { lambda: 0.2, mu: 0.02, reach_px: 3.0, scale: 4.5, model_share: 0.6 }
    }
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

/// The field that, added to T, best maps the current frame into a reference, from a start: one robust Gauss–Newton step. The
/// last frame's field is so good a start that four steps find nothing better (F1 turning .843 with one, .837 with two).
///
/// `reference` is in the brightness of the current frame; `moving` marks pixels that take no part.
pub(crate) fn estimate(current: &Level, reference: &Plane<f32>, moving: &Plane<u8>, start: Motion, rule: &LocalRule) -> Motion {
    let mut motion = start;
    let cells = normal_equations(current, reference, moving, &motion, rule.scale);
    solve(&cells, &mut motion.field, rule);
    motion
}

/// The equations of each cell, from all pixels that say something.
fn normal_equations(current: &Level, reference: &Plane<f32>, moving: &Plane<u8>, motion: &Motion, scale: f32) -> Vec<Cell> {
    let (width, height) = (reference.width(), reference.height());
    let (edge, columns) = (motion.field.cell(), motion.field.columns());
    let mut cells = vec![Cell::default(); motion.field.cells().len()];
    let mut row = Row { sums: std::array::from_fn(|_| vec![0.0; width]), ..Row::default() };
    for v in 0..height {
        if v % 2 == 1 {
            add_row(current, reference, moving, motion, v, 1.0 / scale, &mut row);
        }
        if (v + 1) % edge == 0 || v + 1 == height {
            for (k, cell) in cells[v / edge * columns..][..columns].iter_mut().enumerate() {
                let across = k * edge..((k + 1) * edge).min(width);
                let [uu, uv, vv, u, v] = [0, 1, 2, 3, 4].map(|n: usize| total(&row.sums[n][across.clone()]));
                *cell = Cell { uu, uv, vv, u, v };
            }
            row.sums.iter_mut().for_each(|sums| sums.fill(0.0));
        }
    }
    cells
}

/// The sum of values, four at a time.
fn total(values: &[f32]) -> f32 {
    let (fours, rest) = values.as_chunks::<4>();
    let [a, b, c, d] =
        fours.iter().fold([0.0; 4], |sums, four| [sums[0] + four[0], sums[1] + four[1], sums[2] + four[2], sums[3] + four[3]]);
    (a + c) + (b + d) + rest.iter().sum::<f32>()
}

/// What is known of a row of pixels.
#[derive(Debug, Default)]
struct Row {
    places: Places,
    grid: Grid,
    /// The reference at the places.
    values: Vec<f32>,
    /// Residuals and how much they count.
    residuals: Vec<f32>,
    weights: Vec<f32>,
    /// The products of each column, summed down a cell: those of [`Cell`], in its order.
    sums: [Vec<f32>; 5],
}

vectorised! {
    /// Compares row `v` with the reference and adds it to the sums.
    fn add_row(current: &Level, reference: &Plane<f32>, moving: &Plane<u8>, motion: &Motion, v: usize, per_scale: f32, row: &mut Row) {
        let width = reference.width();
        let (image, gu, gv, moving) = (current.image.row(v), current.gradient_u.row(v), current.gradient_v.row(v), moving.row(v));
        motion.places(v, width, &mut row.places);
        row.grid.set(&row.places, width, reference.height());
        row.values.resize(width, 0.0);
        row.grid.linear(reference, &mut row.values);
        row.residuals.resize(width, 0.0);
        row.weights.resize(width, 0.0);
        let out = row.residuals.iter_mut().zip(&mut row.weights);
        let known = image.iter().zip(&row.values).zip(gu.iter().zip(gv)).zip(moving.iter().zip(row.grid.inside()));
        for ((residual, weight), (((z, value), (gu, gv)), (moving, inside))) in out.zip(known) {
            let usable = (gu * gu + gv * gv > GRADIENT_MIN * GRADIENT_MIN) & (*moving == 0) & (*inside >= BETWEEN);
            let e = z - value;
            let t = e * per_scale;
            let w = 1.0 / ((1.0 + t * t) * (1.0 + t * t));
            *residual = e;
            *weight = if usable { w } else { 0.0 };
        }
        let all = || row.weights.iter().zip(gu).zip(gv).zip(&row.residuals);
        let [uu, uv, vv, u, v] = &mut row.sums;
        for ((uu, u), (((w, gu), _), e)) in uu.iter_mut().zip(u).zip(all()) {
            *uu += w * gu * gu;
            *u += w * gu * e;
        }
        for ((vv, v), (((w, _), gv), e)) in vv.iter_mut().zip(v).zip(all()) {
            *vv += w * gv * gv;
            *v += w * gv * e;
        }
        for (uv, (((w, gu), gv), _)) in uv.iter_mut().zip(all()) {
            *uv += w * gu * gv;
        }
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
