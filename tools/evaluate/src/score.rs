//! Maps, verdicts and tracks against the truth.

use std::collections::BTreeSet;

use geometry::{Cell, CellSize};
use messages::{FilterVerdict, SonarMotion, seconds};
use serde::Serialize;

use crate::comparison::Cells;
use crate::drive::Drive;
use crate::judge::of_walker;
use crate::occupancy::Occupancy;
use crate::truth::{Truth, cells_near, in_map};

/// A cell this near to a true surface is right, m.
const TOLERANCE_M: f64 = 0.1;
/// A wrong cell this near to a walker's way is a ghost, m.
const GHOST_M: f64 = 0.55;

/// The cells of a drive by what is true of them.
#[derive(Debug, Clone)]
pub struct Labels {
    /// Near a true surface.
    surface: BTreeSet<Cell>,
    /// Near a walker's way and not near a surface.
    haunted: BTreeSet<Cell>,
    /// Places on surfaces, with the cells near each.
    places: Vec<[f64; 2]>,
    size: CellSize,
}

/// Counts that add up over drives.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize)]
pub struct Tally {
    /// Ghost cells with every reading counted.
    pub ghosts_before: usize,
    /// Ghost cells of the map.
    pub ghosts_after: usize,
    /// Ghost cells with true labels.
    pub ghosts_oracle: usize,
    /// As `ghosts_before`, with the cells that are wrong without walkers as well.
    pub wrong_before: usize,
    /// As `ghosts_after`, with these.
    pub wrong_after: usize,
    /// Wall cells with true labels.
    pub walls_oracle: usize,
    /// Of these, not in the map.
    pub walls_lost_oracle: usize,
    /// Wall cells without walkers.
    pub walls_reference: usize,
    /// Of these, not in the map.
    pub walls_lost_reference: usize,
    /// Occupied cells.
    pub occupied: usize,
    /// Of these, near a surface.
    pub right: usize,
    /// Places of surfaces that the drive could see.
    pub places: usize,
    /// Of these, near an occupied cell.
    pub found: usize,
    /// Echoes of walkers.
    pub walker_echoes: usize,
    /// Of these, withheld.
    pub withheld_walkers: usize,
    /// Withheld in all.
    pub withheld: usize,
    /// Echoes in all.
    pub echoes: usize,
    /// Cells against the maps of true labels and of the empty building.
    pub cells: Cells,
}

/// Shares from 0 to 1.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Score {
    /// Share of the ghost cells that are gone.
    pub ghosts_removed: f64,
    /// The same of all wrong cells near a walker's path, whatever their cause: also those of a mirror or of another sonar, which
    /// the drive without walkers has too. No filter for walkers can remove these.
    pub ghosts_removed_literal: f64,
    /// Share of the wall cells that true labels give and that are not there.
    pub walls_lost: f64,
    /// The same against the drive without walkers.
    pub walls_lost_reference: f64,
    /// Share of the occupied cells that are right.
    pub precision: f64,
    /// Share of the visible surfaces that are there.
    pub recall: f64,
    /// Their harmonic mean.
    pub f1: f64,
}

impl Labels {
    /// The cells of a drive by what is true of them.
    #[must_use]
    pub fn new(truth: &Truth, size: CellSize) -> Self {
        let surface = cells_near(size, truth.surface_places_m(), TOLERANCE_M);
        let mut haunted = cells_near(size, truth.ways_m.iter().copied(), GHOST_M);
        haunted.retain(|cell| !surface.contains(cell));
        Self { surface, haunted, places: truth.surface_places_m().collect(), size }
    }

    /// Ghost cells of a map: occupied, away from every surface, near a walker's way. A cell that the drive without walkers
    /// takes for occupied as well is wrong for another reason, and none.
    pub fn ghosts<'a>(&'a self, map: &'a Occupancy, reference: &'a Occupancy) -> impl Iterator<Item = &'a Cell> {
        self.wrong(map).filter(|cell| !reference.occupied.contains(cell))
    }

    /// The same without regard to the reason: occupied, away from every surface, near a walker's way.
    fn wrong<'a>(&'a self, map: &'a Occupancy) -> impl Iterator<Item = &'a Cell> {
        map.occupied.intersection(&self.haunted)
    }

    /// Wall cells of a map.
    pub fn walls<'a>(&'a self, map: &'a Occupancy) -> impl Iterator<Item = &'a Cell> {
        map.occupied.intersection(&self.surface)
    }

    /// What there is to count in a map.
    #[must_use]
    pub fn tally(&self, map: &Occupancy, before: &Occupancy, oracle: &Occupancy, reference: &Occupancy) -> Tally {
        let lost = |from: &Occupancy| self.walls(from).filter(|cell| !map.occupied.contains(cell)).count();
        let near = |place: &[f64; 2], cells: &BTreeSet<Cell>| {
            let [x, y] = *place;
            let rows = self.size.index_of(y - TOLERANCE_M)..=self.size.index_of(y + TOLERANCE_M);
            rows.into_iter().any(|row| {
                let mut columns = self.size.index_of(x - TOLERANCE_M)..=self.size.index_of(x + TOLERANCE_M);
                columns.any(|column| {
                    let near = (self.size.centre_of(column) - x).hypot(self.size.centre_of(row) - y) <= TOLERANCE_M;
                    near && cells.contains(&Cell { row, column })
                })
            })
        };
        let visible: Vec<&[f64; 2]> = self.places.iter().filter(|place| near(place, &reference.touched)).collect();
        Tally {
            ghosts_before: self.ghosts(before, reference).count(),
            ghosts_after: self.ghosts(map, reference).count(),
            ghosts_oracle: self.ghosts(oracle, reference).count(),
            wrong_before: self.wrong(before).count(),
            wrong_after: self.wrong(map).count(),
            walls_oracle: self.walls(oracle).count(),
            walls_lost_oracle: lost(oracle),
            walls_reference: self.walls(reference).count(),
            walls_lost_reference: lost(reference),
            occupied: map.occupied.len(),
            right: self.walls(map).count(),
            places: visible.len(),
            found: visible.iter().filter(|place| near(place, &map.occupied)).count(),
            cells: Cells::count(map, before, oracle, reference, self.size),
            ..Tally::default()
        }
    }
}

impl Tally {
    /// Counts what verdicts say of each echo.
    pub fn count_verdicts(&mut self, drive: &Drive, verdicts: &[FilterVerdict]) {
        for (scan, verdict) in drive.scans.iter().zip(verdicts) {
            let readings = scan.scan.readings().iter().zip(&scan.truth.readings);
            for (index, (_, truth)) in readings.enumerate().filter(|(_, (reading, _))| reading.echo != 0) {
                self.echoes += 1;
                self.walker_echoes += usize::from(of_walker(truth));
                self.withheld += usize::from(verdict.withholds(index));
                self.withheld_walkers += usize::from(verdict.withholds(index) && of_walker(truth));
            }
        }
    }

    /// Both counts together.
    #[must_use]
    pub fn with(&self, other: &Self) -> Self {
        Self {
            ghosts_before: self.ghosts_before + other.ghosts_before,
            ghosts_after: self.ghosts_after + other.ghosts_after,
            ghosts_oracle: self.ghosts_oracle + other.ghosts_oracle,
            wrong_before: self.wrong_before + other.wrong_before,
            wrong_after: self.wrong_after + other.wrong_after,
            walls_oracle: self.walls_oracle + other.walls_oracle,
            walls_lost_oracle: self.walls_lost_oracle + other.walls_lost_oracle,
            walls_reference: self.walls_reference + other.walls_reference,
            walls_lost_reference: self.walls_lost_reference + other.walls_lost_reference,
            occupied: self.occupied + other.occupied,
            right: self.right + other.right,
            places: self.places + other.places,
            found: self.found + other.found,
            walker_echoes: self.walker_echoes + other.walker_echoes,
            withheld_walkers: self.withheld_walkers + other.withheld_walkers,
            withheld: self.withheld + other.withheld,
            echoes: self.echoes + other.echoes,
            cells: self.cells.with(&other.cells),
        }
    }

    /// As shares.
    #[must_use]
    pub fn score(&self) -> Score {
        let share = |part: usize, total: usize| if total == 0 { 0.0 } else { part as f64 / total as f64 };
        let (precision, recall) = (share(self.right, self.occupied), share(self.found, self.places));
        let removed = |after: usize, before: usize| if before == 0 { 1.0 } else { 1.0 - share(after, before) };
        Score {
            ghosts_removed: removed(self.ghosts_after, self.ghosts_before),
            ghosts_removed_literal: removed(self.wrong_after, self.wrong_before),
            walls_lost: share(self.walls_lost_oracle, self.walls_oracle),
            walls_lost_reference: share(self.walls_lost_reference, self.walls_reference),
            precision,
            recall,
            f1: if precision + recall > 0.0 { 2.0 * precision * recall / (precision + recall) } else { 0.0 },
        }
    }
}

/// How well STD tells walkers, echo by echo.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
pub struct Detection {
    /// Echoes of walkers within the sonars that take part.
    pub walker_echoes: usize,
    /// Of these, in a mover.
    pub detected: usize,
    /// Echoes in a mover.
    pub reported: usize,
    /// Movers without an echo of a walker.
    pub false_alarms: usize,
    /// Time of the drive, minutes.
    pub minutes: f64,
}

impl Detection {
    /// Both counts together.
    #[must_use]
    pub fn with(&self, other: &Self) -> Self {
        Self {
            walker_echoes: self.walker_echoes + other.walker_echoes,
            detected: self.detected + other.detected,
            reported: self.reported + other.reported,
            false_alarms: self.false_alarms + other.false_alarms,
            minutes: self.minutes + other.minutes,
        }
    }

    /// Counts STD's answers; sonars that look further aside than `aside_rad` take no part.
    #[must_use]
    pub fn count(drive: &Drive, motions: &[SonarMotion], aside_rad: f64) -> Self {
        let (first, last) = (drive.scans.first(), drive.scans.last());
        let span_ns = first.zip(last).map_or(0, |(first, last)| last.stamp_ns.saturating_sub(first.stamp_ns));
        let mut detection = Self { minutes: seconds(span_ns) / 60.0, ..Self::default() };
        for (scan, motion) in drive.scans.iter().zip(motions) {
            let readings = scan.scan.readings().iter().zip(&scan.truth.readings).enumerate();
            let mut walkers = 0u32;
            for (index, (_, truth)) in readings.filter(|(_, (reading, _))| reading.echo != 0 && reading.mount.yaw_rad.abs() <= aside_rad) {
                let reported = motion.movers().iter().any(|mover| mover.readings & (1 << index) != 0);
                walkers |= u32::from(of_walker(truth)) << index;
                detection.walker_echoes += usize::from(of_walker(truth));
                detection.detected += usize::from(reported && of_walker(truth));
                detection.reported += usize::from(reported);
            }
            detection.false_alarms += motion.movers().iter().filter(|mover| mover.readings & walkers == 0).count();
        }
        detection
    }
}

/// Distances of the walkers' true places from the nearest track, m, for walkers within `reach_m` before the robot.
#[must_use]
pub fn track_errors_m(drive: &Drive, tracks_m: &[Vec<[f64; 2]>], reach_m: f64) -> Vec<f64> {
    let mut errors = Vec::new();
    for (scan, tracks) in drive.scans.iter().zip(tracks_m) {
        let robot = &scan.truth.pose;
        for walker in &scan.truth.walkers_m[..scan.truth.walkers_count as usize] {
            let [ahead, aside] = in_map(robot, *walker);
            if ahead <= 0.0 || aside.abs() > 0.6 * ahead || ahead.hypot(aside) > reach_m {
                continue;
            }
            let odometry = &scan.truth.odometry;
            let place = odometry.then(&messages::Pose { x_m: ahead, y_m: aside, yaw_rad: 0.0 });
            let distances = tracks.iter().map(|track| (track[0] - place.x_m).hypot(track[1] - place.y_m));
            let nearest = distances.fold(f64::INFINITY, f64::min);
            if nearest.is_finite() {
                errors.push(nearest);
            }
        }
    }
    errors
}
