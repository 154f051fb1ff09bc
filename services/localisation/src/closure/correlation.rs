//! Where a query lies on a reference: every shift and turn within reach is scored, coarsely, then finely about the best.

use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

use super::Point;
use super::field::{Field, Turned};
use crate::rigid::Rigid;

/// Cells and deviation of the field, and steps of shift and turn: coarse, then fine. m and rad (1.5° and 0.5°).
const GRIDS: [Grid; 2] =
    [Grid { cell: 0.1, deviation: 0.13, shift: 0.1, turn: 0.026_18 }, Grid { cell: 0.05, deviation: 0.07, shift: 0.03, turn: 0.008_727 }];
/// Steps of the fine grid to either side: it covers more than a step of the coarse one.
const FINE_STEPS: [i32; 2] = [10, 4];
/// Fewer points, or less weight, are no place: points of query and reference, and the query's weight.
const LEAST_POINTS: usize = 40;
const LEAST_WEIGHT: f64 = 25.0;
/// The likelihood of a pose is exp(this × score): measured so that the spread of good poses is that of their errors.
const SHARPNESS: f64 = 60.0;
/// Where the coarse likelihood spreads by more, m, its covariance counts: along a corridor the fine grid sees only its own reach.
const WIDE_M: f64 = 0.2;
/// Deviations of the best match: m and rad (0.4°).
const MATCH: [f64; 3] = [0.02, 0.02, 0.006_98];

#[derive(Debug, Clone, Copy)]
struct Grid {
    cell: f64,
    deviation: f64,
    shift: f64,
    turn: f64,
}

/// Where to look: the reference, and the query in its frame as far as is known.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, Schema)]
pub(crate) struct Region {
    pub(crate) points: Vec<Point>,
    pub(crate) guess: Rigid,
    /// To either side, m and rad.
    pub(crate) reach: [f64; 2],
}

/// The query in the frame of the reference.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Hit {
    pub(crate) pose: Rigid,
    /// Share of the query that lies on the reference, 0 to 1.
    pub(crate) score: f64,
    /// Inverse covariance.
    pub(crate) information: [[f64; 3]; 3],
}

/// Scores of a grid of poses about a centre.
#[derive(Debug, Clone)]
struct Scores {
    grid: Grid,
    field: Field,
    centre: Rigid,
    /// Steps to either side, of shift and turn.
    steps: [i32; 2],
    scores: Vec<f32>,
    /// The query turned for the present row.
    turned: Option<(i32, Vec<Turned>)>,
}

impl Scores {
    fn new(grid: Grid, points: &[Point], centre: Rigid, steps: [i32; 2]) -> Self {
        Self { grid, field: Field::new(points, grid.cell, grid.deviation), centre, steps, scores: Vec::new(), turned: None }
    }

    fn per_side(&self, axis: usize) -> usize {
        2 * self.steps[axis] as usize + 1
    }

    fn pose(&self, index: usize) -> Rigid {
        let side = self.per_side(0);
        let step = |index: usize, axis: usize| f64::from(index as i32 - self.steps[axis]);
        let [shift, turn] = [self.grid.shift, self.grid.turn];
        let Rigid { x, y, yaw } = self.centre;
        Rigid::new(x + shift * step(index % side, 0), y + shift * step(index / side % side, 0), yaw + turn * step(index / (side * side), 1))
    }

    /// Scores rows until about `work` points were looked up; whether all are scored.
    fn score(&mut self, query: &[Point], mut work: usize) -> bool {
        let side = self.per_side(0);
        let total = side * side * self.per_side(1);
        while self.scores.len() < total && work > 0 {
            let turn = (self.scores.len() / (side * side)) as i32;
            let yaw = self.pose(self.scores.len()).yaw;
            if self.turned.as_ref().is_none_or(|(known, _)| *known != turn) {
                self.turned = Some((turn, self.field.turned(query, yaw)));
            }
            let Some((_, points)) = &self.turned else { return true };
            let row = self.scores.len()..self.scores.len() + side;
            let scores: Vec<f32> = row.map(|index| self.pose(index)).map(|pose| self.field.score(points, [pose.x, pose.y])).collect();
            self.scores.extend(scores);
            work = work.saturating_sub(side * query.len());
        }
        self.scores.len() >= total
    }

    /// The best pose and its score; the first of equals.
    fn best(&self) -> (Rigid, f64) {
        let best = self
            .scores
            .iter()
            .enumerate()
            .fold((0, 0.0), |best: (usize, f32), (index, score)| if *score > best.1 { (index, *score) } else { best });
        (self.pose(best.0), f64::from(best.1))
    }

    /// Second moments of the likelihood about a pose.
    fn spread(&self, total: f64, about: &Rigid) -> [[f64; 3]; 3] {
        let (_, best) = self.best();
        let (mut moments, mut sum) = ([[0.0; 3]; 3], 0.0);
        for (index, score) in self.scores.iter().enumerate() {
            let exponent = SHARPNESS * (f64::from(*score) - best) / total;
            // Poses 20 e-folds below the best add nothing.
            if exponent < -20.0 {
                continue;
            }
            let (likelihood, pose) = (libm::exp(exponent), self.pose(index));
            let offset = [pose.x - about.x, pose.y - about.y, pose.yaw - about.yaw];
            sum += likelihood;
            for (row, a) in moments.iter_mut().zip(offset) {
                for (moment, b) in row.iter_mut().zip(offset) {
                    *moment += likelihood * a * b;
                }
            }
        }
        moments.map(|row| row.map(|moment| moment / sum))
    }
}

/// A search that is under way.
#[derive(Debug, Clone, Default)]
pub(crate) struct Correlation {
    coarse: Option<Scores>,
    fine: Option<Scores>,
}

impl Correlation {
    /// Looks up about `work` points of a field, or builds one; whether the search is over.
    pub(crate) fn work(&mut self, query: &[Point], region: &Region, work: usize) -> bool {
        if query.len() < LEAST_POINTS || region.points.len() < LEAST_POINTS || weight(query) < LEAST_WEIGHT {
            return true;
        }
        let Some(coarse) = &mut self.coarse else {
            let steps =
                [region.reach[0] / GRIDS[0].shift, region.reach[1] / GRIDS[0].turn].map(|steps| steps.ceil().clamp(0.0, 100.0) as i32);
            self.coarse = Some(Scores::new(GRIDS[0], &region.points, region.guess, steps));
            return false;
        };
        if !coarse.score(query, work) {
            return false;
        }
        let Some(fine) = &mut self.fine else {
            self.fine = Some(Scores::new(GRIDS[1], &region.points, coarse.best().0, FINE_STEPS));
            return false;
        };
        fine.score(query, work)
    }

    /// The best pose, after the search.
    pub(crate) fn hit(&self, query: &[Point]) -> Option<Hit> {
        let (coarse, fine) = (self.coarse.as_ref()?, self.fine.as_ref()?);
        let total = weight(query);
        let (pose, score) = fine.best();
        let wide = coarse.spread(total, &pose);
        let is_wide = wide[0][0].max(wide[1][1]) > WIDE_M * WIDE_M;
        let mut covariance = if is_wide { wide } else { fine.spread(total, &pose) };
        for (k, deviation) in MATCH.into_iter().enumerate() {
            covariance[k][k] += deviation * deviation;
        }
        Some(Hit { pose, score: score / total, information: inverse(&covariance)? })
    }
}

fn weight(query: &[Point]) -> f64 {
    query.iter().map(|point| f64::from(point.weight)).sum()
}

/// By cofactors; `None` of a singular matrix.
fn inverse(m: &[[f64; 3]; 3]) -> Option<[[f64; 3]; 3]> {
    let cofactor = |i: usize, j: usize| {
        let ([a, b], [c, d]) = ([(i + 1) % 3, (i + 2) % 3], [(j + 1) % 3, (j + 2) % 3]);
        m[a][c] * m[b][d] - m[a][d] * m[b][c]
    };
    let determinant: f64 = (0..3).map(|j| m[0][j] * cofactor(0, j)).sum();
    let inverse = [0, 1, 2].map(|i| [0, 1, 2].map(|j| cofactor(j, i) / determinant));
    (determinant > 0.0 && inverse.iter().flatten().all(|number| number.is_finite())).then_some(inverse)
}
