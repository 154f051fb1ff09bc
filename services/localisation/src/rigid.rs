//! Poses in the plane, and angles.
//!
//! The sine and its relatives are those of the library `libm`, which uses basic operations alone: those of the system differ in
//! their last bit from machine to machine, and a solver's next comparison would carry the difference on.

use geometry::Transform;
use messages::Pose;
use postcard_schema::Schema;
use serde::{Deserialize, Serialize};
use std::f64::consts::{FRAC_PI_2, TAU};

/// A pose in the plane: m and rad.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize, Schema)]
pub(crate) struct Rigid {
    pub(crate) x: f64,
    pub(crate) y: f64,
    pub(crate) yaw: f64,
}

impl Rigid {
    pub(crate) const fn new(x: f64, y: f64, yaw: f64) -> Self {
        Self { x, y, yaw }
    }

    pub(crate) const fn of(pose: &Pose) -> Self {
        Self::new(pose.x_m, pose.y_m, pose.yaw_rad)
    }

    /// The pose of C in A, from this pose of B in A and that of C in B.
    pub(crate) fn then(&self, next: &Self) -> Self {
        let [x, y] = self.apply([next.x, next.y]);
        Self::new(x, y, self.yaw + next.yaw)
    }

    /// A point's place in A, from its place in B.
    pub(crate) fn apply(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        let [cos, sin] = unit(self.yaw);
        [self.x + cos * x - sin * y, self.y + sin * x + cos * y]
    }

    /// The pose of C in B, from this pose of B in A and that of C in A.
    pub(crate) fn to(&self, other: &Self) -> Self {
        let [cos, sin] = unit(self.yaw);
        let (x, y) = (other.x - self.x, other.y - self.y);
        Self::new(cos * x + sin * y, cos * y - sin * x, other.yaw - self.yaw)
    }

    pub(crate) fn inverse(&self) -> Self {
        self.to(&Self::default())
    }

    pub(crate) fn distance(&self, other: &Self) -> f64 {
        length([other.x - self.x, other.y - self.y])
    }
}

impl<A, B> From<&Rigid> for Transform<A, B> {
    fn from(pose: &Rigid) -> Self {
        Self::new(pose.x, pose.y, pose.yaw)
    }
}

/// Cosine and sine.
pub(crate) fn unit(angle: f64) -> [f64; 2] {
    let (sin, cos) = libm::sincos(angle);
    [cos, sin]
}

/// Coordinates along a direction and to its left.
pub(crate) fn along([cos, sin]: [f64; 2], [x, y]: [f64; 2]) -> [f64; 2] {
    [cos * x + sin * y, cos * y - sin * x]
}

pub(crate) fn length([x, y]: [f64; 2]) -> f64 {
    (x * x + y * y).sqrt()
}

/// The same angle from −π to π.
pub(crate) fn wrap(angle: f64) -> f64 {
    angle - TAU * (angle / TAU).round()
}

/// The same angle modulo a right angle, from −45° to 45°.
pub(crate) fn wrap_square(angle: f64) -> f64 {
    angle - FRAC_PI_2 * (angle / FRAC_PI_2).round()
}

/// The rigid motion that lays `points` on `targets` with the smallest sum of squares; the identity without points.
pub(crate) fn alignment(points: &[[f64; 2]], targets: &[[f64; 2]]) -> Rigid {
    let count = points.len().min(targets.len());
    if count == 0 {
        return Rigid::default();
    }
    let mean = |list: &[[f64; 2]]| {
        let sum = list[..count].iter().fold([0.0, 0.0], |sum, point| [sum[0] + point[0], sum[1] + point[1]]);
        sum.map(|number| number / count as f64)
    };
    let (from, to) = (mean(points), mean(targets));
    let (mut cos, mut sin) = (0.0, 0.0);
    for (point, target) in points.iter().zip(targets) {
        let (p, t) = ([point[0] - from[0], point[1] - from[1]], [target[0] - to[0], target[1] - to[1]]);
        cos += p[0] * t[0] + p[1] * t[1];
        sin += p[0] * t[1] - p[1] * t[0];
    }
    let turn = Rigid::new(0.0, 0.0, libm::atan2(sin, cos));
    let [x, y] = turn.apply(from);
    Rigid::new(to[0] - x, to[1] - y, turn.yaw)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn poses() -> impl Strategy<Value = Rigid> {
        (-50.0..50.0, -50.0..50.0, -7.0..7.0).prop_map(|(x, y, yaw)| Rigid::new(x, y, yaw))
    }

    fn differ(one: &Rigid, other: &Rigid) -> f64 {
        one.distance(other) + wrap(one.yaw - other.yaw).abs()
    }

    proptest! {
        #[test]
        fn from_here_to_there_and_then_is_there(here in poses(), there in poses()) {
            prop_assert!(differ(&here.then(&here.to(&there)), &there) < 1e-9);
            prop_assert!(differ(&here.then(&here.inverse()), &Rigid::default()) < 1e-9);
        }

        #[test]
        fn poses_join_as_those_of_messages(one in poses(), other in poses()) {
            let wire = |pose: &Rigid| Pose::new(pose.x, pose.y, pose.yaw);
            prop_assert!(differ(&Rigid::of(&wire(&one).then(&wire(&other))), &one.then(&other)) < 1e-9);
        }

        #[test]
        fn a_moved_shape_is_laid_back_on_itself(motion in poses(), points in proptest::collection::vec((-5.0..5.0, -5.0..5.0), 3..20)) {
            let points: Vec<[f64; 2]> = points.into_iter().map(|(x, y)| [x, y]).collect();
            let moved: Vec<[f64; 2]> = points.iter().map(|point| motion.apply(*point)).collect();
            prop_assert!(differ(&alignment(&points, &moved), &motion) < 1e-6);
        }
    }

    #[test]
    fn angles_wrap_to_the_nearest_turn() {
        assert!((wrap(7.0) - (7.0 - TAU)).abs() < 1e-12 && (wrap(-3.5) - (TAU - 3.5)).abs() < 1e-12);
        assert!((wrap_square(1.5) - (1.5 - FRAC_PI_2)).abs() < 1e-12);
    }
}
