//! Free floor of a plan, and paths over it.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::plan::{Goal, Plan, Spot};

/// Edge of a cell, m.
const CELL_M: f64 = 0.1;
/// The robot keeps this distance from things, m.
const ROBOT_M: f64 = 0.45;
/// People keep this one, m.
pub(super) const PERSON_M: f64 = 0.3;
/// Length of the drive, m.
const DRIVE_M: std::ops::Range<f64> = 12.0..30.0;

/// The distance of every cell's centre from the nearest thing.
pub(super) struct Floor {
    origin: Spot,
    columns: usize,
    rows: usize,
    clearance_m: Vec<f64>,
}

impl Floor {
    pub(super) fn new(plan: &Plan) -> Self {
        let [[x0, y0], [x1, y1]] = plan.extent;
        let (columns, rows) = (((x1 - x0) / CELL_M).ceil() as usize, ((y1 - y0) / CELL_M).ceil() as usize);
        let mut floor = Self { origin: [x0, y0], columns, rows, clearance_m: Vec::new() };
        floor.clearance_m = (0..columns * rows).map(|at| clearance_m(plan, floor.spot(at))).collect();
        floor
    }

    fn spot(&self, at: usize) -> Spot {
        let (row, column) = (at / self.columns, at % self.columns);
        [self.origin[0] + (column as f64 + 0.5) * CELL_M, self.origin[1] + (row as f64 + 0.5) * CELL_M]
    }

    fn at(&self, [x, y]: Spot) -> Option<usize> {
        let (column, row) = ((x - self.origin[0]) / CELL_M, (y - self.origin[1]) / CELL_M);
        let inside = column >= 0.0 && row >= 0.0 && (column as usize) < self.columns && (row as usize) < self.rows;
        inside.then(|| row as usize * self.columns + column as usize)
    }

    /// Whether a place is as far from things.
    pub(super) fn is_free(&self, spot: Spot, keep_m: f64) -> bool {
        self.at(spot).is_some_and(|at| self.clearance_m[at] >= keep_m)
    }

    /// A random place as far from things.
    pub(super) fn random(&self, chance: &mut ChaCha8Rng, keep_m: f64) -> Option<Spot> {
        (0..200).map(|_| self.spot(chance.random_range(0..self.clearance_m.len()))).find(|spot| self.is_free(*spot, keep_m))
    }

    fn sees(&self, from: Spot, to: Spot, keep_m: f64) -> bool {
        let steps = ((to[0] - from[0]).hypot(to[1] - from[1]) / (CELL_M / 2.0)).ceil().max(1.0);
        (0..=steps as usize).all(|step| {
            let share = step as f64 / steps;
            self.is_free([from[0] + share * (to[0] - from[0]), from[1] + share * (to[1] - from[1])], keep_m)
        })
    }

    /// The corners of a short path that keeps this distance from things, without its start.
    pub(super) fn path(&self, from: Spot, to: Spot, keep_m: f64) -> Option<Vec<Spot>> {
        let (start, goal) = (self.at(from)?, self.at(to)?);
        let mut cost = vec![u32::MAX; self.clearance_m.len()];
        let mut before = vec![usize::MAX; self.clearance_m.len()];
        let mut heap = BinaryHeap::from([Reverse((0_u32, start))]);
        cost[start] = 0;
        while let Some(Reverse((so_far, at))) = heap.pop() {
            if at == goal {
                break;
            }
            if so_far > cost[at] {
                continue;
            }
            let (row, column) = (at / self.columns, at % self.columns);
            for (d_row, d_column, step) in
                [(0, 1, 10), (0, -1, 10), (1, 0, 10), (-1, 0, 10), (1, 1, 14), (1, -1, 14), (-1, 1, 14), (-1, -1, 14_u32)]
            {
                let Some((row, column)) = row.checked_add_signed(d_row).zip(column.checked_add_signed(d_column)) else { continue };
                if row >= self.rows || column >= self.columns {
                    continue;
                }
                let next = row * self.columns + column;
                if self.clearance_m[next] >= keep_m && so_far + step < cost[next] {
                    cost[next] = so_far + step;
                    before[next] = at;
                    heap.push(Reverse((so_far + step, next)));
                }
            }
        }
        if cost[goal] == u32::MAX {
            return None;
        }
        let mut cells = vec![goal];
        while let Some(&last) = cells.last()
            && last != start
        {
            cells.push(before[last]);
        }
        cells.reverse();
        let mut corners = vec![from];
        let mut spots: Vec<Spot> = cells.iter().skip(1).map(|at| self.spot(*at)).collect();
        if let Some(last) = spots.last_mut() {
            *last = to;
        }
        for pair in spots.windows(2) {
            let last = corners[corners.len() - 1];
            if !self.sees(last, pair[1], keep_m) {
                corners.push(pair[0]);
            }
        }
        corners.push(to);
        corners.remove(0);
        Some(corners)
    }
}

/// Distance of a place from the nearest thing; negative outside of the rooms.
fn clearance_m(plan: &Plan, [x, y]: Spot) -> f64 {
    let within = plan.rooms.iter().any(|[[x0, y0], [x1, y1]]| (*x0..=*x1).contains(&x) && (*y0..=*y1).contains(&y));
    if !within {
        return -1.0;
    }
    let to_line = plan
        .walls
        .iter()
        .flat_map(|wall| wall.corners.windows(2))
        .map(|pair| distance_m([x, y], pair[0], pair[1]))
        .fold(f64::INFINITY, f64::min);
    let to_box = plan.boxes.iter().map(|thing| {
        let [dx, dy] = [0, 1].map(|axis| (([x, y][axis] - thing.centre[axis]).abs() - thing.size[axis] / 2.0).max(0.0));
        dx.hypot(dy)
    });
    let to_pillar = plan.pillars.iter().map(|pillar| (x - pillar.centre[0]).hypot(y - pillar.centre[1]) - pillar.radius_m);
    to_box.chain(to_pillar).fold(to_line, f64::min)
}

fn distance_m([x, y]: Spot, [ax, ay]: Spot, [bx, by]: Spot) -> f64 {
    let (dx, dy) = (bx - ax, by - ay);
    let squared = dx * dx + dy * dy;
    let share = if squared > 0.0 { (((x - ax) * dx + (y - ay) * dy) / squared).clamp(0.0, 1.0) } else { 0.0 };
    (x - ax - share * dx).hypot(y - ay - share * dy)
}

/// Length of a path.
pub(super) fn length_m(from: Spot, path: &[Spot]) -> f64 {
    let ends = std::iter::once(&from).chain(path).zip(path);
    ends.map(|(a, b)| (b[0] - a[0]).hypot(b[1] - a[1])).sum()
}

/// Gives the plan a drive. `None` if there is no room for one.
pub(super) fn route(plan: &mut Plan, chance: &mut ChaCha8Rng) -> Option<()> {
    let floor = Floor::new(plan);
    plan.start = floor.random(chance, ROBOT_M)?;
    plan.speed_m_s = chance.random_range(0.2..0.38);
    let wanted_m = chance.random_range(DRIVE_M);
    let (mut at, mut driven_m) = (plan.start, 0.0);
    for _ in 0..40 {
        let goal = floor.random(chance, ROBOT_M)?;
        let Some(corners) = floor.path(at, goal, ROBOT_M) else { continue };
        let length = length_m(at, &corners);
        // Goals far away make paths as a robot drives them.
        if length < 2.5 {
            continue;
        }
        driven_m += length;
        plan.path.extend(corners.iter().map(|to| Goal { to: *to, stop_s: 0.0 }));
        if chance.random_bool(0.3)
            && let Some(last) = plan.path.last_mut()
        {
            last.stop_s = 1.0;
        }
        at = goal;
        if driven_m >= wanted_m {
            break;
        }
    }
    let first = plan.path.first()?.to;
    plan.heading_deg = (first[1] - plan.start[1]).atan2(first[0] - plan.start[0]).to_degrees();
    (driven_m >= DRIVE_M.start).then_some(())
}
