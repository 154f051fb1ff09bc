//! The cells of a sonar's cone, a few neighbours at a time.

use std::ops::{Range, RangeInclusive};

use grid::{Cell, CellSize, TileKey};
use messages::{Pose, SonarReading};

use crate::numeric::azimuth;

/// Neighbouring cells of a row that are worked on together. It divides a tile's edge, so that groups never straddle tiles.
pub(crate) const LANES: usize = 8;
const _: () = assert!(grid::TILE_EDGE.is_multiple_of(LANES));

/// A sonar's cone in the map frame, up to a distance.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Cone {
    cell: CellSize,
    /// The transducer, m.
    x: f64,
    y: f64,
    /// The axis.
    cos: f64,
    sin: f64,
    /// Tangent of half the opening angle.
    tan_half: f64,
    /// How far it reaches, m.
    reach: f64,
}

/// Where a group of cells lies in the sonar's frame; lane i is the cell i columns on.
pub(crate) struct Group {
    /// Distances from the transducer, m; infinite outside the opening angle.
    pub(crate) z: [f32; LANES],
    along: [f32; LANES],
    across: [f32; LANES],
}

impl Cone {
    /// The cone of a reading's sonar on a robot at `map_from_robot`, up to `reach` m, with half the opening angle in rad, below 90°.
    pub(crate) fn new(cell: CellSize, map_from_robot: &Pose, reading: &SonarReading, half_beam_rad: f64, reach: f64) -> Self {
        let map_from_sonar = map_from_robot.then(&reading.mount);
        let (sin, cos) = map_from_sonar.yaw_rad.sin_cos();
        Self { cell, x: map_from_sonar.x_m, y: map_from_sonar.y_m, cos, sin, tan_half: half_beam_rad.tan(), reach: reach.max(0.0) }
    }

    /// The same cone with another reach, m.
    pub(crate) fn reaching(self, reach: f64) -> Self {
        Self { reach: reach.max(0.0), ..self }
    }

    /// The rows that may hold cells of the cone.
    pub(crate) fn rows(&self) -> RangeInclusive<i32> {
        self.indices(self.y, self.sin, self.cos)
    }

    /// The tiles that may hold cells of the cone.
    pub(crate) fn tiles(&self) -> impl Iterator<Item = TileKey> + use<> {
        let (rows, columns) = (self.rows(), self.indices(self.x, self.cos, -self.sin));
        // A row's own columns may round to the cell beside.
        let first = Cell { row: *rows.start(), column: columns.start().saturating_sub(1) }.tile();
        let last = Cell { row: *rows.end(), column: columns.end().saturating_add(1) }.tile();
        (first.row..=last.row).flat_map(move |row| (first.column..=last.column).map(move |column| TileKey { row, column }))
    }

    /// The indices of cells that the cone covers along x or y: from the transducer's coordinate, and the components of the axis
    /// and of the direction left of it.
    fn indices(&self, from: f64, ahead: f64, left: f64) -> RangeInclusive<i32> {
        let corner = |side: f64| (ahead + side * self.tan_half * left) / (1.0 + self.tan_half * self.tan_half).sqrt();
        let (one, other) = (corner(1.0), corner(-1.0));
        // The arc bulges beyond its corners when the opening holds the direction of the coordinate itself.
        let bulges = left.abs() <= self.tan_half * ahead.abs();
        let highest = if bulges && ahead > 0.0 { 1.0 } else { one.max(other).max(0.0) };
        let lowest = if bulges && ahead < 0.0 { -1.0 } else { one.min(other).min(0.0) };
        self.cell.index_of(from + self.reach * lowest)..=self.cell.index_of(from + self.reach * highest)
    }

    /// The columns of a row that may hold cells of the cone, widened to whole groups. Empty when there are none.
    pub(crate) fn columns(&self, row: i32) -> Range<i32> {
        let dy = self.cell.centre_of(row) - self.y;
        let room = self.reach * self.reach - dy * dy;
        if room < 0.0 {
            return 0..0;
        }
        let widest = room.sqrt();
        let (mut low, mut high) = (-widest, widest);
        // Inside the opening angle: tan·along ± across ≥ 0 on both sides; each is a bound on dx at this dy.
        for side in [1.0, -1.0] {
            let per_dx = self.tan_half * self.cos - side * self.sin;
            let rest = (self.tan_half * self.sin + side * self.cos) * dy;
            if per_dx > 0.0 {
                low = low.max(-rest / per_dx);
            } else if per_dx < 0.0 {
                high = high.min(-rest / per_dx);
            }
        }
        let group = LANES as i32;
        let first = self.cell.index_of(self.x + low) & !(group - 1);
        let last = self.cell.index_of(self.x + high) | (group - 1);
        first..last.saturating_add(1)
    }

    /// Where the group that begins at this cell lies.
    #[inline(always)]
    pub(crate) fn group(&self, row: i32, column: i32) -> Group {
        let dx = self.cell.centre_of(column) - self.x;
        let dy = self.cell.centre_of(row) - self.y;
        let along = (dx * self.cos + dy * self.sin) as f32;
        let across = (dy * self.cos - dx * self.sin) as f32;
        let along_per_cell = (self.cell.metres() * self.cos) as f32;
        let across_per_cell = (-self.cell.metres() * self.sin) as f32;
        let tan_half = self.tan_half as f32;
        let mut group = Group { z: [0.0; LANES], along: [0.0; LANES], across: [0.0; LANES] };
        for lane in 0..LANES {
            let along = along + lane as f32 * along_per_cell;
            let across = across + lane as f32 * across_per_cell;
            let inside = across.abs() <= tan_half * along;
            let z = (along * along + across * across).sqrt();
            group.along[lane] = along;
            group.across[lane] = across;
            group.z[lane] = if inside { z } else { f32::INFINITY };
        }
        group
    }
}

impl Group {
    /// Azimuth of a lane inside the opening angle, rad.
    #[inline(always)]
    pub(crate) fn theta(&self, lane: usize) -> f32 {
        azimuth(self.along[lane], self.across[lane])
    }
}
