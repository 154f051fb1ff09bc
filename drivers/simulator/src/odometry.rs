//! The robot's odometry: true motion in the frame of its start, with the world's errors.

use messages::Pose;
use rand_chacha::ChaCha8Rng;

use crate::chance::normal;
use crate::world::OdometryError;

/// Counts the robot's way as its wheels see it.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Odometry {
    error: OdometryError,
    start: Pose,
    last_true: Pose,
    counted: Pose,
}

impl Odometry {
    /// At the start, which is the origin of its frame.
    pub(crate) fn new(error: OdometryError, start: Pose) -> Self {
        Self { error, start, last_true: start, counted: Pose::default() }
    }

    /// The robot in the frame of its start, after the last step.
    pub(crate) fn counted(&self) -> Pose {
        self.counted
    }

    /// The robot in the frame of its start, after it has moved to `now`.
    ///
    /// Without errors it is the true place, however many steps led there.
    pub(crate) fn step(&mut self, now: Pose, chance: &mut ChaCha8Rng) -> Pose {
        if self.error == OdometryError::default() {
            self.counted = seen_from(&self.start, &now);
        } else {
            let moved = seen_from(&self.last_true, &now);
            let way_m = moved.x_m.hypot(moved.y_m);
            let distance = 1.0 + self.error.distance_share.get();
            let wander_rad = self.error.wander_deg.get().to_radians() * way_m.sqrt() * normal(chance);
            let step = Pose {
                x_m: moved.x_m * distance,
                y_m: moved.y_m * distance,
                yaw_rad: moved.yaw_rad * (1.0 + self.error.turn_share.get()) + wander_rad,
            };
            self.counted = self.counted.then(&step);
        }
        self.last_true = now;
        self.counted
    }
}

/// `other` in the frame of `pose`; both in one frame.
pub(crate) fn seen_from(pose: &Pose, other: &Pose) -> Pose {
    let (sin, cos) = pose.yaw_rad.sin_cos();
    let (x_m, y_m) = (other.x_m - pose.x_m, other.y_m - pose.y_m);
    Pose { x_m: cos * x_m + sin * y_m, y_m: cos * y_m - sin * x_m, yaw_rad: other.yaw_rad - pose.yaw_rad }
}

#[cfg(test)]
mod tests {
    use rand_chacha::rand_core::SeedableRng;

    use super::*;

    fn drive(error: &str) -> Pose {
        let start = Pose { x_m: 1.0, y_m: 2.0, yaw_rad: std::f64::consts::FRAC_PI_2 };
        let mut odometry = Odometry::new(document::parse("test", error).unwrap(), start);
        let mut chance = ChaCha8Rng::seed_from_u64(1);
        (1..=100).map(|step| odometry.step(Pose { y_m: 2.0 + 0.1 * f64::from(step), ..start }, &mut chance)).last().unwrap()
    }

    #[test]
    fn exact_unless_told_otherwise() {
        let end = drive("");
        assert!((end.x_m - 10.0).abs() < 1e-9 && end.y_m.abs() < 1e-9 && end.yaw_rad.abs() < 1e-9, "{end:?}");
    }

    #[test]
    fn errors_add_up_along_the_way() {
        let end = drive("distance_share = 0.05");
        assert!((end.x_m - 10.5).abs() < 1e-9, "{end:?}");
        let wandered = drive("wander_deg = 2.0").yaw_rad.to_degrees().abs();
        assert!((0.1..20.0).contains(&wandered), "{wandered} deg after 10 m, expected about 6");
    }
}
