//! How a filtered map compares with the map that true labels give and with that of the empty building.

use std::collections::{BTreeSet, VecDeque};

use geometry::{Cell, CellSize};
use serde::Serialize;

use crate::occupancy::Occupancy;

/// Radius of the robot that is to drive by the map, m: the configuration space is computed for it.
const ROBOT_M: f64 = 0.25;

/// Counts of cells that add up over drives.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize)]
pub struct Cells {
    /// Occupied with every reading counted, but not with true labels: what walkers cause.
    pub caused: usize,
    /// Of these, still occupied in the map.
    pub caused_left: usize,
    /// Occupied with true labels.
    pub true_labels: usize,
    /// Of these, not occupied in the map.
    pub lost: usize,
    /// Cells that differ from the map of true labels, with every reading counted.
    pub differ_before: usize,
    /// Cells that differ from the map of true labels, in the map.
    pub differ_after: usize,
    /// Against the map of the empty building.
    pub unfiltered: Overlap,
    /// The same of the map.
    pub filtered: Overlap,
    /// The same of the map of true labels.
    pub oracle: Overlap,
    /// Reachable places of the robot in the empty building.
    pub places: usize,
    /// Of these, not reachable in the map.
    pub places_blocked: usize,
    /// Of these, not reachable with every reading counted.
    pub places_blocked_before: usize,
}

/// Occupied cells of a map and of the empty building, with a tolerance of one cell.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize)]
pub struct Overlap {
    /// Cells of the map next to a cell of the building, or on it.
    pub right: usize,
    /// Cells of the map.
    pub of_map: usize,
    /// Cells of the building next to a cell of the map, or on it.
    pub found: usize,
    /// Cells of the building.
    pub of_building: usize,
}

impl Overlap {
    fn between(map: &BTreeSet<Cell>, building: &BTreeSet<Cell>) -> Self {
        let matched = |of: &BTreeSet<Cell>, with: &BTreeSet<Cell>| of.iter().filter(|cell| is_near(cell, with)).count();
        Self { right: matched(map, building), of_map: map.len(), found: matched(building, map), of_building: building.len() }
    }

    /// Both counts together.
    #[must_use]
    pub fn with(&self, other: &Self) -> Self {
        Self {
            right: self.right + other.right,
            of_map: self.of_map + other.of_map,
            found: self.found + other.found,
            of_building: self.of_building + other.of_building,
        }
    }

    /// Intersection over union, 0 to 1; 1 where both are empty.
    #[must_use]
    pub fn iou(&self) -> f64 {
        let both = 0.5 * (self.right + self.found) as f64;
        let union = (self.of_map - self.right) as f64 + (self.of_building - self.found) as f64 + both;
        if union > 0.0 { both / union } else { 1.0 }
    }
}

fn is_near(cell: &Cell, cells: &BTreeSet<Cell>) -> bool {
    (cell.row - 1..=cell.row + 1)
        .any(|row| cells.range(Cell { row, column: cell.column - 1 }..=Cell { row, column: cell.column + 1 }).next().is_some())
}

impl Cells {
    /// Compares the maps of one drive: filtered, with every reading counted, with true labels, and of the drive without walkers.
    #[must_use]
    pub fn count(map: &Occupancy, before: &Occupancy, oracle: &Occupancy, empty: &Occupancy, size: CellSize) -> Self {
        let (m, u, o) = (&map.occupied, &before.occupied, &oracle.occupied);
        let caused: BTreeSet<Cell> = u.difference(o).copied().collect();
        let building = reachable(empty, size);
        let blocked = |map: &Occupancy| building.difference(&reachable(map, size)).count();
        Self {
            caused: caused.len(),
            caused_left: caused.intersection(m).count(),
            true_labels: o.len(),
            lost: o.difference(m).count(),
            differ_before: u.symmetric_difference(o).count(),
            differ_after: m.symmetric_difference(o).count(),
            unfiltered: Overlap::between(u, &empty.occupied),
            filtered: Overlap::between(m, &empty.occupied),
            oracle: Overlap::between(o, &empty.occupied),
            places: building.len(),
            places_blocked: blocked(map),
            places_blocked_before: blocked(before),
        }
    }

    /// Both counts together.
    #[must_use]
    pub fn with(&self, other: &Self) -> Self {
        Self {
            caused: self.caused + other.caused,
            caused_left: self.caused_left + other.caused_left,
            true_labels: self.true_labels + other.true_labels,
            lost: self.lost + other.lost,
            differ_before: self.differ_before + other.differ_before,
            differ_after: self.differ_after + other.differ_after,
            unfiltered: self.unfiltered.with(&other.unfiltered),
            filtered: self.filtered.with(&other.filtered),
            oracle: self.oracle.with(&other.oracle),
            places: self.places + other.places,
            places_blocked: self.places_blocked + other.places_blocked,
            places_blocked_before: self.places_blocked_before + other.places_blocked_before,
        }
    }
}

/// Cells in which the centre of the robot can stand and that it can reach from the origin, where the drive starts.
fn reachable(map: &Occupancy, size: CellSize) -> BTreeSet<Cell> {
    let reach = (ROBOT_M / size.metres()).floor() as i32;
    let disc: Vec<(i32, i32)> = (-reach..=reach)
        .flat_map(|row| (-reach..=reach).map(move |column| (row, column)))
        .filter(|(row, column)| row * row + column * column <= reach * reach)
        .collect();
    let blocked: BTreeSet<Cell> = map
        .occupied
        .iter()
        .flat_map(|cell| disc.iter().map(|(row, column)| Cell { row: cell.row + row, column: cell.column + column }))
        .collect();
    let is_free = |cell: &Cell| map.touched.contains(cell) && !blocked.contains(cell);
    let mut seen = BTreeSet::new();
    let mut queue = VecDeque::new();
    let origin = Cell { row: size.index_of(0.0), column: size.index_of(0.0) };
    // The robot starts where it stands, whatever the map says of that place.
    for (row, column) in &disc {
        let cell = Cell { row: origin.row + row, column: origin.column + column };
        if is_free(&cell) && seen.insert(cell) {
            queue.push_back(cell);
        }
    }
    while let Some(Cell { row, column }) = queue.pop_front() {
        for next in [(row - 1, column), (row + 1, column), (row, column - 1), (row, column + 1)].map(|(row, column)| Cell { row, column }) {
            if is_free(&next) && seen.insert(next) {
                queue.push_back(next);
            }
        }
    }
    seen
}

#[cfg(test)]
mod tests {
    #![allow(clippy::float_cmp, clippy::unwrap_used, reason = "exact values")]
    use super::*;

    const CELL_M: f64 = 0.05;

    /// A map of a picture: `#` occupied, `.` free, a space untouched. The first cell of the first row is at this row and column.
    fn map(rows: &[&str], row: i32, column: i32) -> Occupancy {
        let mut map = Occupancy::default();
        for (row, text) in (row..).zip(rows) {
            for (column, shown) in (column..).zip(text.chars()).filter(|(_, shown)| *shown != ' ') {
                let cell = Cell { row, column };
                map.touched.insert(cell);
                if shown == '#' {
                    map.occupied.insert(cell);
                }
            }
        }
        map
    }

    #[test]
    fn overlap_tolerates_one_cell_and_counts_both_sides() {
        let cells = |text| map(&[text], 0, 0).occupied;
        let iou = |a, b| Overlap::between(&cells(a), &cells(b)).iou();
        assert_eq!(iou("", ""), 1.0);
        assert_eq!(iou("##   ", "##   "), 1.0);
        assert_eq!(iou("#    ", " #   "), 1.0);
        assert_eq!(iou("#    ", "  #  "), 0.0);
        // One cell in common, one of the map too many, one of the building missing.
        assert_eq!(iou("#  #   ", "#     #"), 1.0 / 3.0);
    }

    /// A corridor of 3 m by 1 m around the origin, with this in its row of the origin.
    fn corridor(middle: &str) -> Occupancy {
        let wall = "#".repeat(60);
        let free = format!("#{}#", ".".repeat(58));
        let mut rows = vec![wall.as_str()];
        rows.extend(std::iter::repeat_n(free.as_str(), 9));
        rows.push(middle);
        rows.extend(std::iter::repeat_n(free.as_str(), 9));
        rows.push(wall.as_str());
        map(&rows, -10, -20)
    }

    #[test]
    fn what_blocks_the_passage_blocks_all_behind_it() {
        let size = CellSize::new(CELL_M).unwrap();
        let empty = corridor(&format!("#{}#", ".".repeat(58)));
        let with_post = corridor(&format!("#{}#{}#", ".".repeat(29), ".".repeat(28)));
        let cells = Cells::count(&empty, &with_post, &empty, &empty, size);
        assert_eq!((cells.caused, cells.caused_left, cells.differ_before, cells.differ_after), (1, 0, 1, 0));
        // The centre of the robot stays 0.3 m from the walls: rows -4 to 4, columns -14 to 33.
        assert_eq!((cells.places, cells.places_blocked), (9 * 48, 0));
        assert!(cells.places_blocked_before > cells.places / 2, "{cells:?}");
    }
}
