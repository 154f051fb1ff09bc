//! A sonar reading in the map frame: the cone that the ping filled, and the arc that its echo came from.
//!
//! Lengths in metres, angles in radians. A cell belongs to a cone or an arc when its centre does.

use crate::{Cell, CellSize};
use messages::{Pose, SonarReading};
use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

/// No sonar of a mobile robot hears farther; what claims to is cut here, so that work and memory stay bounded.
const FARTHEST_M: f64 = 10.0;

/// No map reaches farther from its origin: what messages allow, and room for the way from robot to sonar.
const FARTHEST_FROM_ORIGIN_M: f64 = 1.1e6;

/// One reading, seen from above.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, Schema)]
#[serde(try_from = "SavedBeam")]
pub struct Beam {
    /// The transducer in the map frame.
    x_m: f64,
    y_m: f64,
    /// The axis.
    cos: f64,
    sin: f64,
    range_m: f64,
    echo: bool,
    /// Tangent of half the opening angle.
    tan_half: f64,
}

/// A beam as bytes have it.
#[derive(Deserialize)]
struct SavedBeam {
    x_m: f64,
    y_m: f64,
    cos: f64,
    sin: f64,
    range_m: f64,
    echo: bool,
    tan_half: f64,
}

impl TryFrom<SavedBeam> for Beam {
    type Error = &'static str;

    fn try_from(saved: SavedBeam) -> Result<Self, &'static str> {
        let SavedBeam { x_m, y_m, cos, sin, range_m, echo, tan_half } = saved;
        let is_somewhere = [x_m, y_m].iter().all(|at_m| at_m.abs() <= FARTHEST_FROM_ORIGIN_M);
        let is_a_direction = (cos.hypot(sin) - 1.0).abs() < 1e-9;
        let is_a_cone = (0.0..=FARTHEST_M).contains(&range_m) && tan_half >= 0.0 && tan_half.is_finite();
        let beam = Self { x_m, y_m, cos, sin, range_m, echo, tan_half };
        (is_somewhere && is_a_direction && is_a_cone).then_some(beam).ok_or("no beam is like that")
    }
}

/// A place in the sonar's frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct InBeam {
    /// Along the axis, m.
    pub along_m: f64,
    /// To the left of the axis, m.
    pub across_m: f64,
}

impl InBeam {
    /// Distance from the transducer (z of the paper), m.
    #[must_use]
    pub fn z_m(&self) -> f64 {
        self.along_m.hypot(self.across_m)
    }
}

impl Beam {
    /// The beam of a reading taken by a robot at `map_from_robot`; `half_beam_rad` is half its opening angle, below 90°.
    #[must_use]
    pub fn new(map_from_robot: &Pose, reading: &SonarReading, half_beam_rad: f64) -> Self {
        let map_from_sonar = map_from_robot.then(&reading.mount);
        let (sin, cos) = map_from_sonar.yaw_rad.sin_cos();
        Self {
            x_m: map_from_sonar.x_m,
            y_m: map_from_sonar.y_m,
            cos,
            sin,
            range_m: reading.range_m.clamp(0.0, FARTHEST_M),
            echo: reading.echo != 0,
            tan_half: half_beam_rad.tan(),
        }
    }

    /// Where the transducer is in the map frame, m.
    #[must_use]
    pub fn origin_m(&self) -> [f64; 2] {
        [self.x_m, self.y_m]
    }

    /// Direction of the axis in the map frame, of length 1.
    #[must_use]
    pub fn axis(&self) -> [f64; 2] {
        [self.cos, self.sin]
    }

    /// The range, m; where nothing came back, the sonar's limit.
    #[must_use]
    pub fn range_m(&self) -> f64 {
        self.range_m
    }

    /// Whether an echo came back.
    #[must_use]
    pub fn echo(&self) -> bool {
        self.echo
    }

    /// Half the opening angle, rad.
    #[must_use]
    pub fn half_rad(&self) -> f64 {
        self.tan_half.atan()
    }

    /// A place of the map frame in the sonar's.
    #[must_use]
    pub fn see(&self, x_m: f64, y_m: f64) -> InBeam {
        let (dx, dy) = (x_m - self.x_m, y_m - self.y_m);
        InBeam { along_m: dx * self.cos + dy * self.sin, across_m: dy * self.cos - dx * self.sin }
    }

    /// Whether a place of the sonar's frame lies within the opening angle.
    #[must_use]
    pub fn covers(&self, place: InBeam) -> bool {
        place.across_m.abs() <= self.tan_half * place.along_m
    }

    /// Whether a place of the map frame lies on the echo's arc: within the opening angle and `depth_m` of the range.
    #[must_use]
    pub fn echoes_from(&self, x_m: f64, y_m: f64, depth_m: f64) -> bool {
        let place = self.see(x_m, y_m);
        self.echo && self.covers(place) && (place.z_m() - self.range_m).abs() <= depth_m
    }

    /// The cells of the echo's arc: within the opening angle and `depth_m` of the range. None without an echo.
    #[must_use]
    pub fn arc(&self, cell: CellSize, depth_m: f64) -> Vec<Cell> {
        if !self.echo {
            return Vec::new();
        }
        let mut cells = Vec::new();
        self.visit(cell, self.range_m - depth_m, self.range_m + depth_m, self.tan_half, |cell| cells.push(cell));
        cells
    }

    /// Shows the cells within `half_angle_rad` of the axis (and of the opening angle) that are nearer than `reach_m`.
    pub fn visit_cone(&self, cell: CellSize, half_angle_rad: f64, reach_m: f64, visit: impl FnMut(Cell)) {
        self.visit(cell, 0.0, reach_m.min(FARTHEST_M), half_angle_rad.tan().min(self.tan_half), visit);
    }

    /// Shows the cells with z from `near` to `far` and within the angle of this tangent, row by row.
    fn visit(&self, size: CellSize, near: f64, far: f64, tan_half: f64, mut visit: impl FnMut(Cell)) {
        if far <= 0.0 {
            return;
        }
        // The sector's box: its apex, both ends of its arc and, where the arc passes one, its outermost points along x and y.
        let scale = far / (1.0 + tan_half * tan_half).sqrt();
        let corner = |side: f64| [(self.cos - side * tan_half * self.sin) * scale, (self.sin + side * tan_half * self.cos) * scale];
        let (left, right) = (corner(1.0), corner(-1.0));
        let span = |at: f64, across: f64, a: f64, b: f64| {
            let passes = across.abs() <= tan_half * at.abs();
            let low = if passes && at < 0.0 { -far } else { a.min(b).min(0.0) };
            let high = if passes && at > 0.0 { far } else { a.max(b).max(0.0) };
            (low, high)
        };
        let (x_low, x_high) = span(self.cos, self.sin, left[0], right[0]);
        let (y_low, y_high) = span(self.sin, self.cos, left[1], right[1]);
        for row in size.index_of(self.y_m + y_low)..=size.index_of(self.y_m + y_high) {
            for column in size.index_of(self.x_m + x_low)..=size.index_of(self.x_m + x_high) {
                let place = self.see(size.centre_of(column), size.centre_of(row));
                let inside = place.across_m.abs() <= tan_half * place.along_m;
                if inside && (near..=far).contains(&place.z_m()) {
                    visit(Cell { row, column });
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::collections::BTreeSet;

    const HALF_BEAM_RAD: f64 = 0.218;

    fn beam(x_m: f64, y_m: f64, yaw_rad: f64, range_m: f64, echo: u32) -> Beam {
        let reading = SonarReading { range_m, echo, ..SonarReading::default() };
        Beam::new(&Pose { x_m, y_m, yaw_rad }, &reading, HALF_BEAM_RAD)
    }

    fn size() -> CellSize {
        CellSize::new(0.05).unwrap()
    }

    #[test]
    fn an_arc_lies_at_its_range_across_the_axis() {
        let arc = beam(0.0, 0.0, 0.0, 1.0, 1).arc(size(), 0.05);
        let farthest_aside = arc.iter().map(|c| size().centre_of(c.row).abs()).fold(0.0, f64::max);
        assert!((0.17..=0.23).contains(&farthest_aside), "{farthest_aside}: 12.5° at 1.05 m is 0.228 m aside");
        assert!(arc.iter().all(|c| (0.90..=1.06).contains(&size().centre_of(c.column))));
        assert!(arc.len() >= 14, "{} cells", arc.len());
    }

    #[test]
    fn bytes_that_no_reading_makes_are_no_beam() {
        let Beam { x_m, y_m, cos, sin, range_m, echo, tan_half } = beam(1.0, 2.0, 3.0, 4.0, 1);
        let sound = || SavedBeam { x_m, y_m, cos, sin, range_m, echo, tan_half };
        assert_eq!(Beam::try_from(sound()), Ok(beam(1.0, 2.0, 3.0, 4.0, 1)));
        let is_refused = |change: fn(&mut SavedBeam)| {
            let mut saved = sound();
            change(&mut saved);
            Beam::try_from(saved).is_err()
        };
        assert!(is_refused(|saved| saved.x_m = 1e7) && is_refused(|saved| saved.y_m = f64::NAN));
        assert!(is_refused(|saved| saved.cos = 1e3) && is_refused(|saved| saved.sin = f64::INFINITY));
        assert!(is_refused(|saved| saved.range_m = 11.0) && is_refused(|saved| saved.range_m = -1.0));
        assert!(is_refused(|saved| saved.tan_half = -0.1) && is_refused(|saved| saved.tan_half = f64::INFINITY));
    }

    #[test]
    fn silence_has_no_arc() {
        let beam = beam(0.0, 0.0, 0.0, 3.0, 0);
        assert!(beam.arc(size(), 0.05).is_empty() && !beam.echoes_from(3.0, 0.0, 0.1));
    }

    proptest! {
        #[test]
        fn the_cells_visited_are_those_inside(
            x in -3.0..3.0f64, y in -3.0..3.0f64, yaw in -7.0..7.0f64, range in 0.0..2.0f64, reach in 0.0..2.0f64,
        ) {
            let beam = beam(x, y, yaw, range, 1);
            let mut cone = BTreeSet::new();
            beam.visit_cone(size(), 0.1, reach, |cell| { cone.insert(cell); });
            let arc: BTreeSet<Cell> = beam.arc(size(), 0.05).into_iter().collect();
            for row in -120..120 {
                for column in -120..120 {
                    let cell = Cell { row, column };
                    let (cx, cy) = (size().centre_of(column), size().centre_of(row));
                    prop_assert_eq!(arc.contains(&cell), beam.echoes_from(cx, cy, 0.05));
                    let place = beam.see(cx, cy);
                    let inside = place.along_m > 0.0 && (place.across_m / place.along_m).abs() <= 0.1f64.tan() && place.z_m() <= reach;
                    prop_assert_eq!(cone.contains(&cell), inside);
                }
            }
        }

        #[test]
        fn no_reading_takes_more_than_a_bounded_part_of_the_map(x in any::<f64>(), yaw in any::<f64>(), range in any::<f64>()) {
            let beam = beam(x, 0.0, yaw, range, 1);
            prop_assert!(beam.arc(size(), 0.05).len() < 4000);
        }
    }
}
