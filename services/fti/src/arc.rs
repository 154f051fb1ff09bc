//! Something stands where an echo came from (S): what the past and all readings near in time say of the cells of its arc.

use geometry::Cell;
use geometry::{Beam, InBeam};
use nalgebra::Vector2;

use crate::still::{REACH_M, SLOT_NS, Still, balance, free_reach_m};

/// A beam that passes a cell shows it free this close to its axis only, rad.
/// Half: 83.4 % / 1.09 %, twice: 85.4 % / 1.43 %.
const FREE_HALF_RAD: f64 = 0.18;
/// A wall answers towards where it answered before: a beam that passes the cell from a direction this far off says less, rad.
/// Half: 84.9 % / 1.28 %, twice: 85.3 % / 1.50 %.
const SAME_WAY_RAD: f64 = 0.4;
/// But never less than this.
/// Half: 84.6 % / 1.30 %, twice: 85.2 % / 1.51 %.
const OTHER_WAY: f64 = 0.4;
/// Silence in that direction against an echo's passing.
/// Half: 85.0 % / 1.25 %, twice: 84.6 % / 1.56 %.
const SILENCE: f64 = 0.8;

/// The arc of an echo, and what is known of its cells.
#[derive(Debug, Clone)]
pub(crate) struct Arc<'a> {
    beam: &'a Beam,
    cells: Vec<ArcCell>,
    /// Half the depth of an arc, m.
    depth_m: f64,
    /// Half the width of the arc, m.
    half_width_m: f64,
    /// The slot of time that is being counted.
    slot: u64,
}

#[derive(Debug, Clone, Copy, Default)]
struct ArcCell {
    x_m: f64,
    y_m: f64,
    hits: f64,
    free: f64,
    /// Of the slot that is being counted.
    hit: f64,
    passed: f64,
}

impl<'a> Arc<'a> {
    /// With what the past says.
    pub(crate) fn new(still: &Still, beam: &'a Beam, cells: &[Cell]) -> Self {
        let size = still.size();
        let known = |cell: &Cell| {
            let evidence = still.get(*cell);
            let (hits, free) = (f64::from(evidence.hits), f64::from(evidence.free));
            ArcCell { x_m: size.centre_of(cell.column), y_m: size.centre_of(cell.row), hits, free, ..ArcCell::default() }
        };
        Self {
            beam,
            cells: cells.iter().map(known).collect(),
            depth_m: size.metres(),
            half_width_m: (beam.range_m() + size.metres()) * beam.half_rad().sin() + 2.0 * size.metres(),
            slot: u64::MAX,
        }
    }

    /// Takes in another reading; readings come in the order of time. `weight`: how far its echo counts as a hit of something
    /// that stands.
    pub(crate) fn add(&mut self, stamp_ns: u64, beam: &Beam, weight: f64) {
        if stamp_ns / SLOT_NS != self.slot {
            self.end_slot();
            self.slot = stamp_ns / SLOT_NS;
        }
        if !self.is_met_by(beam) {
            return;
        }
        let (asked, depth_m) = (self.beam, self.depth_m);
        for cell in &mut self.cells {
            let place = beam.see(cell.x_m, cell.y_m);
            if !beam.covers(place) {
                continue;
            }
            if beam.echo() && (place.z_m() - beam.range_m()).abs() <= depth_m {
                cell.hit = cell.hit.max(weight);
            }
            if passes(beam, place) {
                cell.passed = cell.passed.max(contradiction(asked, beam, cell));
            }
        }
    }

    /// S: the greatest balance of the cells.
    pub(crate) fn balance(mut self) -> f64 {
        self.end_slot();
        self.cells.iter().map(|cell| balance(cell.hits, cell.free)).fold(f64::NEG_INFINITY, f64::max)
    }

    fn end_slot(&mut self) {
        for cell in &mut self.cells {
            cell.hits += cell.hit;
            cell.free += cell.passed;
            (cell.hit, cell.passed) = (0.0, 0.0);
        }
    }

    /// Whether a beam may reach the arc at all: by a circle around it.
    fn is_met_by(&self, beam: &Beam) -> bool {
        let [x_m, y_m] = self.beam.origin_m();
        let [cos, sin] = self.beam.axis();
        let middle = beam.see(x_m + cos * self.beam.range_m(), y_m + sin * self.beam.range_m());
        let reach_m = if beam.echo() { beam.range_m() } else { REACH_M };
        let widest_m = (middle.along_m + self.half_width_m) * beam.half_rad().tan();
        middle.z_m() - self.half_width_m <= reach_m
            && middle.along_m >= -self.half_width_m
            && middle.across_m.abs() - self.half_width_m <= widest_m
    }
}

/// Whether a beam shows a place free.
fn passes(beam: &Beam, place: InBeam) -> bool {
    place.z_m() < free_reach_m(beam).unwrap_or(REACH_M) && place.across_m.abs() <= FREE_HALF_RAD.tan() * place.along_m
}

/// How much a beam that passes a cell says against an echo's having come from it. What stands answers again towards where it
/// answered before, but a wall is a mirror to who looks at it from elsewhere, so that silence tells something in that one
/// direction alone.
fn contradiction(asked: &Beam, passing: &Beam, cell: &ArcCell) -> f64 {
    let from_cell = |beam: &Beam| {
        let [x_m, y_m] = beam.origin_m();
        Vector2::new(x_m - cell.x_m, y_m - cell.y_m)
    };
    let (a, b) = (from_cell(asked), from_cell(passing));
    let same_way = (-0.5 * (a.perp(&b).atan2(a.dot(&b)) / SAME_WAY_RAD).powi(2)).exp();
    if passing.echo() { OTHER_WAY + (1.0 - OTHER_WAY) * same_way } else { SILENCE * same_way }
}

#[cfg(test)]
mod tests {
    use super::*;
    use geometry::{CellSize, Lattice};
    use messages::{Pose, SonarReading};

    fn beam(x_m: f64, y_m: f64, yaw_rad: f64, range_m: f64) -> Beam {
        let reading = SonarReading { range_m, echo: u32::from(range_m < 3.0), ..SonarReading::default() };
        Beam::new(&Pose { x_m, y_m, yaw_rad }, &reading, 0.218)
    }

    /// S of an echo straight ahead at 1 m, with other readings half a second apart.
    fn balance_with(others: &[(Beam, f64)]) -> f64 {
        let still = Still::new(Lattice::new(CellSize::new(0.05).unwrap()));
        let echo = beam(0.0, 0.0, 0.0, 1.0);
        let cells = echo.arc(still.size(), 0.05);
        let mut arc = Arc::new(&still, &echo, &cells);
        (0..).zip(others).for_each(|(slot, (beam, weight))| arc.add(slot * SLOT_NS, beam, *weight));
        arc.balance()
    }

    #[test]
    fn an_echo_from_the_same_place_counts_by_its_weight() {
        let again = beam(0.0, 0.0, 0.0, 1.0);
        assert_eq!(balance_with(&[]), 0.0);
        assert_eq!(balance_with(&[(again, 1.0)]), 1.0);
        assert_eq!(balance_with(&[(again, 0.25), (again, 1.0)]), 1.25);
    }

    #[test]
    fn beams_that_pass_the_whole_arc_speak_against_it() {
        let fan = [-0.1, 0.0, 0.1].map(|yaw_rad| (beam(0.0, 0.0, yaw_rad, 2.0), 1.0));
        assert!(balance_with(&fan) <= -1.0, "{}", balance_with(&fan));
        assert_eq!(balance_with(&fan[1..2]), 0.0, "cells at the rim of the arc are too far from the axis to be shown free");
    }

    #[test]
    fn a_pass_from_the_same_side_contradicts_more_than_another() {
        let asked = beam(0.0, 0.0, 0.0, 1.0);
        let cell = ArcCell { x_m: 1.0, ..ArcCell::default() };
        let across = |range_m| beam(1.0, -1.0, std::f64::consts::FRAC_PI_2, range_m);
        let said = [beam(0.0, 0.0, 0.0, 2.0), beam(0.0, 0.0, 0.0, 3.0), across(2.0), across(3.0)].map(|b| contradiction(&asked, &b, &cell));
        for (said, expected) in said.into_iter().zip([1.0, SILENCE, OTHER_WAY, 0.0]) {
            assert!((said - expected).abs() < 1e-3, "{said}, expected {expected}");
        }
    }

    #[test]
    fn readings_of_one_slot_count_once() {
        let again = beam(0.0, 0.0, 0.0, 1.0);
        let still = Still::new(Lattice::new(CellSize::new(0.05).unwrap()));
        let cells = again.arc(still.size(), 0.05);
        let mut arc = Arc::new(&still, &again, &cells);
        (0..4).for_each(|part| arc.add(part * SLOT_NS / 4, &again, 1.0));
        assert_eq!(arc.balance(), 1.0);
    }
}
