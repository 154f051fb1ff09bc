//! The cells of a sonar's cone, a few neighbours at a time.

use std::ops::{Range, RangeInclusive};

use grid::{Cell, CellSize, TileKey};
use messages::{Pose, SonarReading};

use crate::numeric::{LANES, Lanes, all, azimuth};

// Groups of cells never straddle tiles.
const _: () = assert!(grid::TILE_EDGE.is_multiple_of(LANES));

/// A sonar's cone in the map frame, up to a distance. Lengths are in cells.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Cone {
    cell_m: f64,
    /// The transducer.
    x: f64,
    y: f64,
    /// The axis.
    cos: f64,
    sin: f64,
    /// Tangent of half the opening angle.
    tan_half: f64,
    /// How far it reaches.
    reach: f64,
}

/// The part of a row that may hold cells of a cone.
#[derive(Debug, Clone)]
pub(crate) struct Row {
    /// The row.
    pub(crate) row: i32,
    /// Its columns, whole groups.
    pub(crate) columns: Range<i32>,
    /// The row's first cell in the sonar's frame, and the step to the next; m.
    along: f32,
    across: f32,
    along_step: f32,
    across_step: f32,
    tan_half: f32,
}

/// Where a group of neighbouring cells lies in the sonar's frame.
#[derive(Clone, Copy)]
pub(crate) struct Group {
    /// Distances from the transducer, m; infinite outside the opening angle.
    pub(crate) z: Lanes,
    along: Lanes,
    across: Lanes,
}

impl Cone {
    /// The cone of a reading's sonar on a robot at `map_from_robot`, up to `reach_m`, with half the opening angle in rad, below 90°.
    pub(crate) fn new(cell: CellSize, map_from_robot: &Pose, reading: &SonarReading, half_beam_rad: f64, reach_m: f64) -> Self {
        let map_from_sonar = map_from_robot.then(&reading.mount);
        let (sin, cos) = map_from_sonar.yaw_rad.sin_cos();
        let cell_m = cell.metres();
        Self {
            cell_m,
            x: map_from_sonar.x_m / cell_m,
            y: map_from_sonar.y_m / cell_m,
            cos,
            sin,
            tan_half: half_beam_rad.tan(),
            reach: (reach_m / cell_m).max(0.0),
        }
    }

    /// The rows that may hold cells of the cone.
    pub(crate) fn rows(&self) -> impl Iterator<Item = Row> {
        indices(self.extent(self.y, self.sin, self.cos)).filter_map(|row| self.row(row))
    }

    /// The tiles that hold every cell of the cone's rows.
    pub(crate) fn tiles(&self) -> impl Iterator<Item = TileKey> + use<> {
        let (rows, columns) = (indices(self.extent(self.y, self.sin, self.cos)), indices(self.extent(self.x, self.cos, -self.sin)));
        // A row's own columns may round to the cell beside.
        let first = Cell { row: *rows.start(), column: columns.start().saturating_sub(1) }.tile();
        let last = Cell { row: *rows.end(), column: columns.end().saturating_add(1) }.tile();
        (first.row..=last.row).flat_map(move |row| (first.column..=last.column).map(move |column| TileKey { row, column }))
    }

    /// From where to where the cone reaches along x or y: from the transducer's coordinate, and the components of the axis and of
    /// the direction left of it.
    fn extent(&self, from: f64, ahead: f64, left: f64) -> (f64, f64) {
        let corner = |side: f64| (ahead + side * self.tan_half * left) / (1.0 + self.tan_half * self.tan_half).sqrt();
        let (one, other) = (corner(1.0), corner(-1.0));
        // The arc bulges beyond its corners when the opening holds the direction of the coordinate itself.
        let bulges = left.abs() <= self.tan_half * ahead.abs();
        let highest = if bulges && ahead > 0.0 { 1.0 } else { one.max(other).max(0.0) };
        let lowest = if bulges && ahead < 0.0 { -1.0 } else { one.min(other).min(0.0) };
        (from + self.reach * lowest, from + self.reach * highest)
    }

    /// The part of a row that may hold cells of the cone, if any.
    fn row(&self, row: i32) -> Option<Row> {
        let dy = f64::from(row) + 0.5 - self.y;
        let room = self.reach * self.reach - dy * dy;
        if room < 0.0 {
            return None;
        }
        let widest = room.sqrt();
        let (mut low, mut high) = (-widest, widest);
        // Inside the opening angle: tan · along ± across ≥ 0 on both sides; each is a bound on dx at this dy.
        for side in [1.0, -1.0] {
            let per_dx = self.tan_half * self.cos - side * self.sin;
            let rest = (self.tan_half * self.sin + side * self.cos) * dy;
            if per_dx > 0.0 {
                low = low.max(-rest / per_dx);
            } else if per_dx < 0.0 {
                high = high.min(-rest / per_dx);
            }
        }
        let columns = indices((self.x + low, self.x + high));
        let group = LANES as i32;
        let (first, last) = (columns.start() & !(group - 1), columns.end() | (group - 1));
        if last < first {
            return None;
        }
        let dx = f64::from(first) + 0.5 - self.x;
        Some(Row {
            row,
            columns: first..last.saturating_add(1),
            along: (self.cell_m * (dx * self.cos + dy * self.sin)) as f32,
            across: (self.cell_m * (dy * self.cos - dx * self.sin)) as f32,
            along_step: (self.cell_m * self.cos) as f32,
            across_step: (-self.cell_m * self.sin) as f32,
            tan_half: self.tan_half as f32,
        })
    }
}

/// The cells in which a stretch begins and ends.
fn indices((from, to): (f64, f64)) -> RangeInclusive<i32> {
    floor(from)..=floor(to)
}

/// The greatest whole number that is not above. The standard one is a call into a library where the processor is not known to have it.
fn floor(number: f64) -> i32 {
    let towards_zero = number as i32;
    towards_zero.saturating_sub(i32::from(number < f64::from(towards_zero)))
}

impl Row {
    /// Where the group of cells that begins at this column of the row lies.
    #[inline(always)]
    pub(crate) fn group(&self, column: i32) -> Group {
        let steps = all(column.wrapping_sub(self.columns.start) as f32) + Lanes::new([0.0, 1.0, 2.0, 3.0]);
        let along = all(self.along) + steps * all(self.along_step);
        let across = all(self.across) + steps * all(self.across_step);
        let inside = across.abs().simd_le(all(self.tan_half) * along);
        let z = (along * along + across * across).sqrt();
        Group { z: inside.select(z, all(f32::INFINITY)), along, across }
    }
}

impl Group {
    /// Azimuths of the cells, rad; of no meaning outside the opening angle.
    #[inline(always)]
    pub(crate) fn theta(&self) -> Lanes {
        azimuth(self.along, self.across)
    }
}
