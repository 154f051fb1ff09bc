//! Corresponding pairs and their update regions (paper section 6, eq. 11, Table 6).

use geometry::Beam;
use geometry::CellSize;
use messages::{Mover, Pose, UpdateRegion};
use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

use crate::tables::{Integration, Seen};

/// A region in the map frame: a disc of as many cells as `O_Size` says.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, Schema)]
pub(crate) struct Region {
    pub(crate) x_m: f64,
    pub(crate) y_m: f64,
    pub(crate) cells: f64,
}

impl Region {
    /// Radius of the disc, m.
    fn radius_m(&self, cell: CellSize) -> f64 {
        (self.cells / std::f64::consts::PI).max(0.0).sqrt() * cell.metres()
    }

    /// Whether the arc of an echo enters the region.
    pub(crate) fn entered_by(&self, beam: &Beam, arc: &[geometry::Cell], cell: CellSize) -> bool {
        let radius_m = self.radius_m(cell);
        let near = |cell_at: &geometry::Cell| {
            (cell.centre_of(cell_at.column) - self.x_m).hypot(cell.centre_of(cell_at.row) - self.y_m) <= radius_m
        };
        beam.echo() && arc.iter().any(near)
    }

    pub(crate) fn message(&self) -> UpdateRegion {
        UpdateRegion { x_m: self.x_m, y_m: self.y_m, cells: self.cells }
    }
}

/// Pairs of C and B by nearest neighbour: DIST (eq. 11) below σ_correspond, each C and each B at most once, nearest first.
pub(crate) fn corresponding(c: &[Seen], b: &[Seen], correspond_m: f64) -> Vec<(usize, usize)> {
    let mut by_distance = Vec::new();
    for (i, c) in c.iter().enumerate() {
        for (j, b) in b.iter().enumerate() {
            let dist = (b.x - c.x).hypot(b.y - c.y);
            if dist < correspond_m {
                by_distance.push((dist, i, j));
            }
        }
    }
    by_distance.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut pairs: Vec<(usize, usize)> = Vec::new();
    for (_, i, j) in by_distance {
        if !pairs.iter().any(|(used_c, used_b)| *used_c == i || *used_b == j) {
            pairs.push((i, j));
        }
    }
    pairs
}

/// The update regions of a scan: O_Centroid and O_Size of each corresponding pair.
pub(crate) fn update_regions(
    integration: &Integration,
    map_from_robot: &Pose,
    movers: &[Mover],
    blobs: &[Seen],
    correspond_m: f64,
) -> Vec<Region> {
    let c: Vec<Seen> = movers.iter().map(|mover| Seen { x: mover.robot_x_m, y: mover.robot_y_m, size: f64::from(mover.cells) }).collect();
    let pairs = corresponding(&c, blobs, correspond_m);
    let inferred = pairs.iter().filter_map(|(i, j)| Some(integration.infer(c.get(*i)?, blobs.get(*j)?)));
    inferred
        .map(|o| {
            let place = map_from_robot.then(&Pose { x_m: o.x, y_m: o.y, yaw_rad: 0.0 });
            Region { x_m: place.x_m, y_m: place.y_m, cells: o.size }
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn seen(x: f64, y: f64) -> Seen {
        Seen { x, y, size: 20.0 }
    }

    #[test]
    fn each_has_one_neighbour_the_nearest_and_none_too_far() {
        let c = [seen(1.0, 0.0), seen(1.3, 0.0), seen(2.0, 2.0)];
        let b = [seen(1.2, 0.0), seen(0.8, 0.0), seen(2.0, 1.4)];
        assert_eq!(corresponding(&c, &b, 0.5), [(1, 0), (0, 1)]);
        assert_eq!(corresponding(&c, &b, 0.7), [(1, 0), (0, 1), (2, 2)]);
    }

    #[test]
    fn an_arc_enters_a_region_that_it_touches() {
        let reading = messages::SonarReading { range_m: 1.0, echo: 1, ..messages::SonarReading::default() };
        let beam = Beam::new(&Pose::default(), &reading, 0.218);
        let cell = CellSize::new(0.05).unwrap();
        let arc = beam.arc(cell, 0.05);
        // 50 cells are a disc of 0.2 m.
        let region = |x_m| Region { x_m, y_m: 0.0, cells: 50.0 };
        assert!(region(1.2).entered_by(&beam, &arc, cell) && !region(1.3).entered_by(&beam, &arc, cell));
    }
}
