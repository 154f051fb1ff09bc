//! Frames of reference, named as in ROS REP 105, and the pose of one in another.
//!
//! *map* is fixed to the building. *odom* is where the wheels count from: continuous, but it drifts against the map. *robot* is the
//! robot's own, with x ahead and y to the left.
//!
//! ```
//! use geometry::{MapFromOdom, OdomFromRobot};
//! # use stillmap_geometry as geometry;
//!
//! let map_from_odom = MapFromOdom::new(0.1, 0.0, 0.0);
//! let odom_from_robot = OdomFromRobot::new(2.0, 1.0, 0.5);
//! let map_from_robot = map_from_odom.then(&odom_from_robot);
//! assert_eq!(map_from_robot.x_m, 2.1);
//! ```
//!
//! Poses whose frames do not meet cannot be joined:
//!
//! ```compile_fail
//! # use stillmap_geometry::{MapFromOdom, OdomFromRobot};
//! OdomFromRobot::IDENTITY.then(&MapFromOdom::IDENTITY);
//! ```

use core::marker::PhantomData;

use messages::{Pose, SonarReading, SonarScan};

/// The frame of the building.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Map;
/// The frame in which the wheels count.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Odom;
/// The frame of the robot.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Robot;
/// The frame of a sonar: its axis is x.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Sonar;

/// The pose of frame `B` in frame `A`, which takes coordinates in `B` to coordinates in `A`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Transform<A, B> {
    /// Along x of `A`, m.
    pub x_m: f64,
    /// Along y of `A`, m.
    pub y_m: f64,
    /// Counter-clockwise from the x axis of `A`, rad.
    pub yaw_rad: f64,
    frames: PhantomData<fn() -> (A, B)>,
}

/// Where odometry has its origin in the map.
pub type MapFromOdom = Transform<Map, Odom>;
/// Where the robot is by its wheels.
pub type OdomFromRobot = Transform<Odom, Robot>;
/// Where the robot is in the map.
pub type MapFromRobot = Transform<Map, Robot>;

impl<A, B> Transform<A, B> {
    /// Both frames are the same.
    pub const IDENTITY: Self = Self::new(0.0, 0.0, 0.0);

    /// A position (m) and direction (rad, counter-clockwise) of `B` in `A`.
    #[must_use]
    pub const fn new(x_m: f64, y_m: f64, yaw_rad: f64) -> Self {
        Self { x_m, y_m, yaw_rad, frames: PhantomData }
    }

    /// A pose that a message holds. The field of the message says which frames it is between.
    #[must_use]
    pub const fn from_wire(pose: &Pose) -> Self {
        Self::new(pose.x_m, pose.y_m, pose.yaw_rad)
    }

    /// As a pose for a message.
    #[must_use]
    pub const fn to_wire(&self) -> Pose {
        Pose::new(self.x_m, self.y_m, self.yaw_rad)
    }

    /// The pose of `C` in `A`, from its pose in `B`.
    #[must_use]
    pub fn then<C>(&self, next: &Transform<B, C>) -> Transform<A, C> {
        let [x_m, y_m] = self.apply([next.x_m, next.y_m]);
        Transform::new(x_m, y_m, self.yaw_rad + next.yaw_rad)
    }

    /// A point (m) in `A`, from its coordinates in `B`.
    #[must_use]
    pub fn apply(&self, [x_m, y_m]: [f64; 2]) -> [f64; 2] {
        let (sin, cos) = self.yaw_rad.sin_cos();
        [self.x_m + cos * x_m - sin * y_m, self.y_m + sin * x_m + cos * y_m]
    }

    /// The pose of `A` in `B`.
    #[must_use]
    pub fn inverse(&self) -> Transform<B, A> {
        let (sin, cos) = self.yaw_rad.sin_cos();
        Transform::new(-cos * self.x_m - sin * self.y_m, sin * self.x_m - cos * self.y_m, -self.yaw_rad)
    }
}

impl OdomFromRobot {
    /// The odometry of a scan.
    #[must_use]
    pub const fn of_scan(scan: &SonarScan) -> Self {
        Self::from_wire(&scan.pose)
    }
}

impl Transform<Robot, Sonar> {
    /// The mount of the sonar that a reading is from.
    #[must_use]
    pub const fn of_reading(reading: &SonarReading) -> Self {
        Self::from_wire(&reading.mount)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::wrapped;
    use core::fmt::Debug;
    use proptest::prelude::*;

    fn poses<A: Debug, B: Debug>() -> impl Strategy<Value = Transform<A, B>> {
        (-100.0..100.0, -100.0..100.0, -10.0..10.0).prop_map(|(x_m, y_m, yaw_rad)| Transform::new(x_m, y_m, yaw_rad))
    }

    fn distance<A, B>(one: &Transform<A, B>, other: &Transform<A, B>) -> f64 {
        (one.x_m - other.x_m).hypot(one.y_m - other.y_m) + wrapped(one.yaw_rad - other.yaw_rad).abs()
    }

    proptest! {
        #[test]
        fn the_inverse_leads_back(map_from_odom in poses::<Map, Odom>(), odom_from_robot in poses::<Odom, Robot>()) {
            let map_from_robot = map_from_odom.then(&odom_from_robot);
            prop_assert!(distance(&map_from_odom.inverse().then(&map_from_robot), &odom_from_robot) < 1e-9);
            prop_assert!(distance(&map_from_robot.then(&odom_from_robot.inverse()), &map_from_odom) < 1e-9);
        }

        #[test]
        fn poses_join_as_those_of_messages(one in poses::<Map, Odom>(), other in poses::<Odom, Robot>()) {
            prop_assert_eq!(one.then(&other).to_wire(), one.to_wire().then(&other.to_wire()));
        }

        #[test]
        fn the_identity_changes_no_number(pose in poses::<Odom, Robot>()) {
            prop_assert_eq!(MapFromOdom::IDENTITY.then(&pose).to_wire(), pose.to_wire());
        }

        #[test]
        fn a_point_moves_with_its_frame(pose in poses::<Map, Robot>(), x_m in -5.0..5.0, y_m in -5.0..5.0) {
            let sonar = pose.then(&Transform::<Robot, Sonar>::new(x_m, y_m, 0.0));
            prop_assert_eq!([sonar.x_m, sonar.y_m], pose.apply([x_m, y_m]));
        }
    }
}
