//! Where things come into the picture.

use messages::Pose;

use crate::geometry::Vector;
use crate::optics::Optics;

/// Nothing nearer than this to the plane of the lens is seen, m.
pub(super) const NEAREST_M: f32 = 0.05;

/// What is farther than this looks as if it were here, m.
const FARTHEST_M: f32 = 500.0;

/// A camera at its place. It stands upright: a small pitch moves the picture up and down, a small roll shears it.
#[derive(Debug, Clone, Copy)]
pub(super) struct View {
    lens: Pose,
    sin: f64,
    cos: f64,
    pub(super) focal_px: f32,
    middle_px: f32,
    horizon_px: f32,
    /// Rows that the horizon falls from one column to the next.
    roll: f32,
    height_m: f32,
}

/// A place in the plane, seen from the lens, m.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Spot {
    pub(super) ahead_m: f32,
    pub(super) left_m: f32,
}

/// What a column of the picture looks along.
#[derive(Debug, Clone, Copy)]
pub(super) struct Sight {
    /// Middle of the column, px.
    pub(super) column_px: f32,
    /// Its width, px.
    pub(super) width_px: f32,
    /// How far to the left it gets on each metre ahead.
    pub(super) slope: f32,
    pub(super) horizon_px: f32,
    pub(super) focal_px: f32,
    pub(super) height_m: f32,
}

impl View {
    /// The view of a robot's camera that is tilted by these small angles, rad: up, and the left side up.
    pub(super) fn new(optics: &Optics, robot: &Pose, pitch_rad: f32, roll_rad: f32) -> Self {
        let lens = robot.then(&optics.mount);
        let (sin, cos) = lens.yaw_rad.sin_cos();
        let focal_px = optics.focal_px() as f32;
        Self {
            lens,
            sin,
            cos,
            focal_px,
            middle_px: optics.size_px[0] as f32 / 2.0,
            horizon_px: optics.horizon_px() as f32 + pitch_rad * focal_px,
            roll: roll_rad,
            height_m: optics.height_m as f32,
        }
    }

    /// A place of the world, seen from the lens.
    pub(super) fn spot(&self, place: &Vector) -> Spot {
        let (dx, dy) = (place.x - self.lens.x_m, place.y - self.lens.y_m);
        Spot { ahead_m: (dx * self.cos + dy * self.sin) as f32, left_m: (dy * self.cos - dx * self.sin) as f32 }
    }

    /// The place in the world of what is seen there.
    pub(super) fn place(&self, spot: Spot) -> (f32, f32) {
        let [cos, sin] = self.towards();
        (self.lens.x_m as f32 + spot.ahead_m * cos - spot.left_m * sin, self.lens.y_m as f32 + spot.ahead_m * sin + spot.left_m * cos)
    }

    /// Cosine and sine of the direction that it looks in.
    pub(super) fn towards(&self) -> [f32; 2] {
        [self.cos as f32, self.sin as f32]
    }

    /// The column of a place before the lens, px.
    pub(super) fn column_px(&self, spot: Spot) -> f32 {
        self.middle_px - self.focal_px * spot.left_m / spot.ahead_m
    }

    /// What a column looks along.
    pub(super) fn sight(&self, column_px: f32, width_px: f32) -> Sight {
        Sight {
            column_px,
            width_px,
            slope: (self.middle_px - column_px) / self.focal_px,
            horizon_px: self.horizon_px + self.roll * (column_px - self.middle_px),
            focal_px: self.focal_px,
            height_m: self.height_m,
        }
    }
}

impl Sight {
    /// The row of what is so high above the floor at a distance ahead, px.
    pub(super) fn row_px(&self, height_m: f32, ahead_m: f32) -> f32 {
        self.horizon_px + self.focal_px * (self.height_m - height_m) / ahead_m
    }

    /// How high above the floor a row looks at a distance ahead, m.
    pub(super) fn height_m(&self, row_px: f32, ahead_m: f32) -> f32 {
        self.height_m + (self.horizon_px - row_px) * ahead_m / self.focal_px
    }

    /// How far ahead a row meets a plane that is so much below the lens (above: negative), m.
    pub(super) fn ahead_m(&self, row_px: f32, below_m: f32) -> f32 {
        let ahead_m = self.focal_px * below_m / (row_px - self.horizon_px);
        if ahead_m > 0.0 { ahead_m.min(FARTHEST_M) } else { FARTHEST_M }
    }

    /// What the column sees so far ahead.
    pub(super) fn spot(&self, ahead_m: f32) -> Spot {
        Spot { ahead_m, left_m: self.slope * ahead_m }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_and_columns_are_those_of_the_ground_cue() {
        let mount = Pose { x_m: 0.1, y_m: 0.0, yaw_rad: 0.0 };
        let optics = Optics {
            mount,
            height_m: 0.3,
            field_of_view_rad: std::f64::consts::FRAC_PI_2,
            horizon_share: 0.5,
            size_px: [160, 120],
            interval_ns: 66_666_667,
        };
        let robot = Pose { x_m: 1.0, y_m: 2.0, yaw_rad: std::f64::consts::FRAC_PI_2 };
        let view = View::new(&optics, &robot, 0.0, 0.0);
        // 2 m ahead of the lens and half a metre to the right: f = 80 px.
        let spot = view.spot(&Vector::new(1.5, 4.1));
        assert!((spot.ahead_m - 2.0).abs() < 1e-6 && (spot.left_m + 0.5).abs() < 1e-6, "{spot:?}");
        assert!((view.column_px(spot) - 100.0).abs() < 1e-4);
        let sight = view.sight(100.0, 1.0);
        assert!((sight.row_px(0.0, 2.0) - 72.0).abs() < 1e-4);
        assert!((sight.ahead_m(72.0, 0.3) - 2.0).abs() < 1e-5);
        let (x_m, y_m) = view.place(sight.spot(2.0));
        assert!((x_m - 1.5).abs() < 1e-5 && (y_m - 4.1).abs() < 1e-5);
    }
}
