//! How near a place is to a point of the reference that faces the same way.

use std::f64::consts::{FRAC_PI_4, TAU};

use super::Point;
use crate::rigid::{Rigid, wrap};

/// Bins of directions: two sides of a wall, and walls at right angles, never share one.
const BINS: usize = 8;
/// A point counts in bins whose middle is within this of its direction, rad.
const WIDTH_RAD: f64 = FRAC_PI_4;
/// Beyond so many deviations a point has no influence.
const REACH: f64 = 2.5;

/// exp(−d² / 2 σ²) of the distance d to the nearest point, in cells, for each bin of directions.
#[derive(Debug, Clone)]
pub(crate) struct Field {
    cell: f64,
    origin: [f64; 2],
    width: usize,
    height: usize,
    values: Vec<f32>,
}

/// A point of the query, turned: its place from the origin of the field, in cells and before any shift, its bin and its weight.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Turned {
    place: [f64; 2],
    bin: usize,
    weight: f32,
}

impl Field {
    /// Of these points, in cells of `cell` m, with σ = `deviation` m. Points without numbers are left out.
    pub(crate) fn new(points: &[Point], cell: f64, deviation: f64) -> Self {
        let reach = (REACH * deviation / cell).ceil();
        let bounds = |of: &dyn Fn(&Point) -> f32| {
            let numbers = points.iter().map(of).filter(|number| number.is_finite());
            numbers
                .fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], number| [low.min(f64::from(number)), high.max(f64::from(number))])
        };
        let axes = [bounds(&|point| point.x), bounds(&|point| point.y)];
        let margin = (reach + 1.0) * cell;
        let origin = axes.map(|[low, _]| low - margin);
        let [width, height] = axes.map(|[low, high]| if low <= high { ((high - low + 2.0 * margin) / cell) as usize + 1 } else { 0 });
        let mut field = Self { cell, origin, width, height, values: vec![0.0; width * height * BINS] };
        points.iter().for_each(|point| field.add(point, deviation, reach as usize));
        field
    }

    fn add(&mut self, point: &Point, deviation: f64, reach: usize) {
        let place = [f64::from(point.x), f64::from(point.y)];
        let Some([column, row]) = self.cell_at(self.in_cells(place)) else { return };
        let (columns, rows) = (
            column.saturating_sub(reach)..(column + reach + 1).min(self.width),
            row.saturating_sub(reach)..(row + reach + 1).min(self.height),
        );
        let weights = |axis: usize, cells: std::ops::Range<usize>| -> Vec<f64> {
            let distance = |index: usize| (index as f64 + 0.5) * self.cell + self.origin[axis] - place[axis];
            cells.map(|index| libm::exp(-0.5 * (distance(index) / deviation) * (distance(index) / deviation))).collect()
        };
        let (across, along) = (weights(0, columns.clone()), weights(1, rows.clone()));
        // Points whose wall is not known count half.
        let strength = 0.5 + 0.5 * f64::from(point.weight);
        for bin in 0..BINS {
            let middle = (bin as f64 + 0.5) * TAU / BINS as f64;
            if wrap(f64::from(point.facing) - middle).abs() > WIDTH_RAD {
                continue;
            }
            for (row, down) in rows.clone().zip(&along) {
                let start = (bin * self.height + row) * self.width + columns.start;
                for (value, side) in self.values[start..].iter_mut().zip(&across) {
                    *value = value.max((strength * down * side) as f32);
                }
            }
        }
    }

    /// The query turned by an angle.
    pub(crate) fn turned(&self, query: &[Point], yaw: f64) -> Vec<Turned> {
        let turn = Rigid::new(0.0, 0.0, yaw);
        let turn_one = |point: &Point| {
            let share = (f64::from(point.facing) + yaw) / TAU;
            let bin = ((share - share.floor()) * BINS as f64) as usize;
            let [x, y] = turn.apply([f64::from(point.x), f64::from(point.y)]);
            Turned { place: self.in_cells([x, y]), bin: bin.min(BINS - 1), weight: point.weight }
        };
        query.iter().map(turn_one).collect()
    }

    fn in_cells(&self, place: [f64; 2]) -> [f64; 2] {
        [0, 1].map(|axis| (place[axis] - self.origin[axis]) / self.cell)
    }

    fn cell_at(&self, [x, y]: [f64; 2]) -> Option<[usize; 2]> {
        (x >= 0.0 && y >= 0.0 && x < self.width as f64 && y < self.height as f64).then_some([x as usize, y as usize])
    }

    /// Sum of the weights of the query, each times the field where the point lies when shifted, m.
    pub(crate) fn score(&self, query: &[Turned], shift: [f64; 2]) -> f32 {
        let [dx, dy] = shift.map(|metres| metres / self.cell);
        let value = |point: &Turned| {
            let [column, row] = self.cell_at([point.place[0] + dx, point.place[1] + dy])?;
            Some(point.weight * self.values[(point.bin * self.height + row) * self.width + column])
        };
        query.iter().filter_map(value).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn point(x: f32, y: f32, facing: f32) -> Point {
        Point { x, y, facing, weight: 1.0 }
    }

    #[test]
    fn the_score_is_highest_on_the_point() {
        let field = Field::new(&[point(1.0, 2.0, 0.3)], 0.01, 0.1);
        let score = |x: f32, y: f32, facing: f32| field.score(&field.turned(&[point(x, y, facing)], 0.0), [0.0, 0.0]);
        assert!(score(1.0, 2.0, 0.3) > 0.9);
        assert!((score(1.1, 2.0, 0.3) - 0.6).abs() < 0.15, "one deviation aside: {}", score(1.1, 2.0, 0.3));
        assert_eq!(score(2.0, 2.0, 0.3), 0.0);
    }

    #[test]
    fn the_other_side_of_a_wall_does_not_count() {
        let field = Field::new(&[point(1.0, 2.0, 0.3)], 0.01, 0.1);
        assert_eq!(field.score(&field.turned(&[point(1.0, 2.0, 0.3 + std::f32::consts::PI)], 0.0), [0.0, 0.0]), 0.0);
    }

    #[test]
    fn shift_and_turn_of_the_query_are_applied() {
        let field = Field::new(&[point(1.0, 2.0, 0.3)], 0.01, 0.1);
        let query = field.turned(&[point(0.0, 1.0, 0.3 - 1.0)], 1.0);
        let expected = [1.0 + 1.0f64.sin(), 2.0 - 1.0f64.cos()];
        assert!(field.score(&query, expected) > 0.9);
    }

    #[test]
    fn no_points_make_an_empty_field() {
        let field = Field::new(&[], 0.05, 0.1);
        assert_eq!(field.score(&field.turned(&[point(0.0, 0.0, 0.0)], 0.0), [0.0, 0.0]), 0.0);
    }
}
