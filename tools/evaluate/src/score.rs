//! Maps and verdicts against the truth.

use std::collections::BTreeSet;

use geometry::{Cell, CellSize};
use messages::FilterVerdict;
use serde::Serialize;

use crate::comparison::Cells;
use crate::drive::Drive;
use crate::judge::of_walker;
use crate::occupancy::Occupancy;
use crate::truth::{Truth, cells_near};

/// A cell this near to a true surface is right, m.
const TOLERANCE_M: f64 = 0.1;
/// A cell this near to where a walker stood or walked is caused by the walker there: half a step and half a shoulder, m.
const NEAR_M: f64 = 0.45;

/// The cells of a drive by what is true of them.
#[derive(Debug, Clone)]
pub struct Labels {
    /// Near a true surface.
    surface: BTreeSet<Cell>,
    /// Near a place where a walker stood.
    stood: BTreeSet<Cell>,
    /// Near the path of a walker.
    walked: BTreeSet<Cell>,
    /// Places on surfaces, with the cells near each.
    places: Vec<[f64; 2]>,
    size: CellSize,
}

/// Counts that add up over drives.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize)]
pub struct Tally {
    /// Cells that walkers caused, by where these were.
    pub ghosts: Ghosts,
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

/// Cells that walkers caused: occupied with every reading counted, but not with true labels.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize)]
pub struct Ghosts {
    /// Within 0.1 m of a surface: tails of the arcs of walls that walkers hid for a time.
    pub at_walls: Removed,
    /// Others within 0.45 m of a place where a walker stood.
    pub standing: Removed,
    /// Others within 0.45 m of a walker's path.
    pub walking: Removed,
    /// Others: mirrored echoes, and the far ends of arcs.
    pub elsewhere: Removed,
}

/// Cells before and after filtering.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize)]
pub struct Removed {
    /// With every reading counted.
    pub before: usize,
    /// Of these, still in the map.
    pub after: usize,
}

impl Removed {
    fn with(&self, other: &Self) -> Self {
        Self { before: self.before + other.before, after: self.after + other.after }
    }
}

impl Ghosts {
    fn with(&self, other: &Self) -> Self {
        Self {
            at_walls: self.at_walls.with(&other.at_walls),
            standing: self.standing.with(&other.standing),
            walking: self.walking.with(&other.walking),
            elsewhere: self.elsewhere.with(&other.elsewhere),
        }
    }
}

/// The measures of a map, as shares: from 0 to 1 but for `net`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Score {
    /// Share of the cells that walkers caused which the filter removed (G); 1 where walkers caused none.
    pub ghosts_removed: f64,
    /// Share of the cells of the true-label map which the filter lost (L).
    pub walls_lost: f64,
    /// Change of the number of cells that differ from the true-label map: −1 where the filter makes the map of the true labels, above
    /// 0 where the map is better without the filter. `None` where nothing differs without the filter.
    pub net: Option<f64>,
    /// Intersection over union of the occupied cells with those of the empty building, with a tolerance of one cell.
    pub iou_empty: f64,
    /// The same without the filter.
    pub iou_empty_unfiltered: f64,
    /// The same with true labels.
    pub iou_empty_true_labels: f64,
    /// Share of the places that a robot of 0.25 m reaches in the empty building, and not in the map.
    pub blocked: f64,
    /// The same without the filter.
    pub blocked_unfiltered: f64,
    /// Share of the occupied cells that are within 0.1 m of a surface.
    pub precision: f64,
    /// Share of the visible surfaces within 0.1 m of an occupied cell.
    pub recall: f64,
    /// Their harmonic mean.
    pub f1: f64,
    /// Static accuracy: share of the echoes of still things that the filter lets into the map.
    pub sa: f64,
    /// Dynamic accuracy: share of the echoes of walkers that it withholds.
    pub da: f64,
    /// Associated accuracy: the geometric mean of both.
    pub aa: f64,
}

impl Labels {
    /// The cells of a drive by what is true of them.
    #[must_use]
    pub fn new(truth: &Truth, size: CellSize) -> Self {
        let surface = cells_near(size, truth.surface_places_m(), TOLERANCE_M);
        let stood = cells_near(size, truth.stands_m.iter().copied(), NEAR_M);
        let walked = cells_near(size, truth.paths_m.iter().copied(), NEAR_M);
        Self { surface, stood, walked, places: truth.surface_places_m().collect(), size }
    }

    /// Wall cells of a map.
    pub fn walls<'a>(&'a self, map: &'a Occupancy) -> impl Iterator<Item = &'a Cell> {
        map.occupied.intersection(&self.surface)
    }

    fn ghosts(&self, map: &Occupancy, before: &Occupancy, oracle: &Occupancy) -> Ghosts {
        let mut ghosts = Ghosts::default();
        for cell in before.occupied.difference(&oracle.occupied) {
            let cause = if self.surface.contains(cell) {
                &mut ghosts.at_walls
            } else if self.stood.contains(cell) {
                &mut ghosts.standing
            } else if self.walked.contains(cell) {
                &mut ghosts.walking
            } else {
                &mut ghosts.elsewhere
            };
            cause.before += 1;
            cause.after += usize::from(map.occupied.contains(cell));
        }
        ghosts
    }

    /// What there is to count in a map.
    #[must_use]
    pub fn tally(&self, map: &Occupancy, before: &Occupancy, oracle: &Occupancy, reference: &Occupancy) -> Tally {
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
            ghosts: self.ghosts(map, before, oracle),
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
            ghosts: self.ghosts.with(&other.ghosts),
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
        let share = |part: usize, total: usize, of_nothing: f64| if total == 0 { of_nothing } else { part as f64 / total as f64 };
        let (precision, recall) = (share(self.right, self.occupied, 0.0), share(self.found, self.places, 0.0));
        let cells = &self.cells;
        let net = (cells.differ_before > 0).then(|| share(cells.differ_after, cells.differ_before, 0.0) - 1.0);
        let still = self.echoes - self.walker_echoes;
        let sa = share(still - (self.withheld - self.withheld_walkers), still, 1.0);
        let da = share(self.withheld_walkers, self.walker_echoes, 1.0);
        Score {
            ghosts_removed: 1.0 - share(cells.caused_left, cells.caused, 0.0),
            walls_lost: share(cells.lost, cells.true_labels, 0.0),
            net,
            iou_empty: cells.filtered.iou(),
            iou_empty_unfiltered: cells.unfiltered.iou(),
            iou_empty_true_labels: cells.oracle.iou(),
            blocked: share(cells.places_blocked, cells.places, 0.0),
            blocked_unfiltered: share(cells.places_blocked_before, cells.places, 0.0),
            precision,
            recall,
            f1: if precision + recall > 0.0 { 2.0 * precision * recall / (precision + recall) } else { 0.0 },
            sa,
            da,
            aa: (sa * da).sqrt(),
        }
    }
}
