//! The cells of a sonar's cone, a few neighbours at a time.

use std::ops::{Range, RangeInclusive};

use geometry::{Cell, CellSize, MapFromRobot, TileKey, Transform};
use messages::SonarReading;

use crate::numeric::{LANES, Lanes, all, azimuth};

// Groups of cells never straddle tiles.
const _: () = assert!(geometry::TILE_EDGE.is_multiple_of(LANES));

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
    edges: [Edge; 2],
}

/// What an edge of the opening angle says of dx at a given dy, both from the transducer.
#[derive(Debug, Clone, Copy)]
enum Edge {
    /// dx is at least this × dy.
    Least(f64),
    /// dx is at most this × dy.
    Most(f64),
    /// The edge runs along x and says nothing.
    AlongRows,
}

impl Edge {
    /// Of the cells with tan · along + `side` · across ≥ 0.
    fn new(sin: f64, cos: f64, tan_half: f64, side: f64) -> Self {
        let per_dx = tan_half * cos - side * sin;
        let slope = -(tan_half * sin + side * cos) / per_dx;
        match per_dx {
            _ if !slope.is_finite() => Self::AlongRows,
            p if p > 0.0 => Self::Least(slope),
            _ => Self::Most(slope),
        }
    }
}

/// The cells of a cone: row by row, whole groups of neighbours, each with its place in the sonar's frame.
#[derive(Debug)]
pub(crate) struct Groups {
    rows: Vec<Row>,
    places: Vec<Group>,
}

/// The part of a row that may hold cells of a cone.
#[derive(Debug, Clone)]
pub(crate) struct Row {
    row: i32,
    /// Whole groups.
    columns: Range<i32>,
    /// Where its first group is among all.
    start: usize,
}

/// Where a group of neighbouring cells lies in the sonar's frame.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Group {
    /// Distances from the transducer, m; infinite outside the opening angle.
    pub(crate) z: Lanes,
    along: Lanes,
    across: Lanes,
}

impl Cone {
    /// The cone of a reading's sonar on a robot at `map_from_robot`, up to `reach_m`, with half the opening angle in rad, below 90°.
    pub(crate) fn new(cell: CellSize, map_from_robot: &MapFromRobot, reading: &SonarReading, half_beam_rad: f64, reach_m: f64) -> Self {
        let map_from_sonar = map_from_robot.then(&Transform::of_reading(reading));
        let (sin, cos) = map_from_sonar.yaw_rad.sin_cos();
        let (cell_m, tan_half) = (cell.metres(), half_beam_rad.tan());
        Self {
            cell_m,
            x: map_from_sonar.x_m / cell_m,
            y: map_from_sonar.y_m / cell_m,
            cos,
            sin,
            tan_half,
            reach: (reach_m / cell_m).max(0.0),
            edges: [1.0, -1.0].map(|side| Edge::new(sin, cos, tan_half, side)),
        }
    }

    /// The cells of the cone, and a few beside it.
    pub(crate) fn groups(&self) -> Groups {
        let (along_step, across_step) = (all((self.cell_m * self.cos) as f32), all((-self.cell_m * self.sin) as f32));
        let (tan_half, lanes) = (all(self.tan_half as f32), Lanes::new([0.0, 1.0, 2.0, 3.0]));
        let rows = indices(self.extent(self.y, self.sin, self.cos));
        let row_count = rows.end().abs_diff(*rows.start()) as usize + 1;
        // The area of the cone, and at either end of a row a group that lies partly beside it.
        let group_count = (self.reach * self.reach * self.tan_half) as usize / LANES + 2 * row_count;
        let mut groups = Groups { rows: Vec::with_capacity(row_count), places: Vec::with_capacity(group_count) };
        for row in rows {
            let Some(columns) = self.columns(row) else { continue };
            let (dx, dy) = (f64::from(columns.start) + 0.5 - self.x, f64::from(row) + 0.5 - self.y);
            let first_along = all((self.cell_m * (dx * self.cos + dy * self.sin)) as f32);
            let first_across = all((self.cell_m * (dy * self.cos - dx * self.sin)) as f32);
            let start = groups.places.len();
            groups.places.extend((0..columns.len() / LANES).map(|group| {
                let steps = all((group * LANES) as f32) + lanes;
                let (along, across) = (first_along + steps * along_step, first_across + steps * across_step);
                let inside = across.abs().simd_le(tan_half * along);
                let z = (along * along + across * across).sqrt();
                Group { z: inside.select(z, all(f32::INFINITY)), along, across }
            }));
            groups.rows.push(Row { row, columns, start });
        }
        groups
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

    /// The columns of a row that may hold cells of the cone, if any, widened to whole groups.
    fn columns(&self, row: i32) -> Option<Range<i32>> {
        let dy = f64::from(row) + 0.5 - self.y;
        let room = self.reach * self.reach - dy * dy;
        if room < 0.0 {
            return None;
        }
        let widest = room.sqrt();
        let (mut low, mut high) = (-widest, widest);
        for edge in &self.edges {
            match *edge {
                Edge::Least(slope) => low = low.max(slope * dy),
                Edge::Most(slope) => high = high.min(slope * dy),
                Edge::AlongRows => {}
            }
        }
        let columns = indices((self.x + low, self.x + high));
        let group = LANES as i32;
        let (first, last) = (columns.start() & !(group - 1), columns.end() | (group - 1));
        // At the very end of the lattice there is no whole group.
        (first <= last && last < i32::MAX).then(|| first..last + 1)
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

impl Groups {
    /// The rows, from the smallest y.
    pub(crate) fn rows(&self) -> &[Row] {
        &self.rows
    }

    /// The groups of a row from this column on.
    #[inline(always)]
    pub(crate) fn of_row_from(&self, row: &Row, column: i32) -> &[Group] {
        let before = column.abs_diff(row.columns.start) as usize / LANES;
        self.places.get(row.start + before..).unwrap_or_default()
    }
}

impl Row {
    /// Its number.
    pub(crate) fn row(&self) -> i32 {
        self.row
    }

    /// Its columns.
    pub(crate) fn columns(&self) -> Range<i32> {
        self.columns.clone()
    }
}

impl Group {
    /// Azimuths of the cells, rad; of no meaning outside the opening angle.
    #[inline(always)]
    pub(crate) fn theta(&self) -> Lanes {
        azimuth(self.along, self.across)
    }
}
