//! How far a trajectory is from the true one.

use geometry::wrapped;
use messages::Pose;
use serde::Serialize;

use crate::drive::Drive;

/// Errors of a trajectory after a rigid alignment with the true one.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
pub struct TrajectoryError {
    /// Root mean square of the distances, m (absolute trajectory error).
    pub distance_m: f64,
    /// Root mean square of the errors of the heading, rad.
    pub heading_rad: f64,
}

impl TrajectoryError {
    /// Of poses, one for each true pose.
    #[must_use]
    pub fn of(poses: &[Pose], truth: &[Pose]) -> Self {
        let count = poses.len().max(1) as f64;
        let aligned = aligned(poses, truth);
        let root_mean_square = |error: &dyn Fn(&Pose, &Pose) -> f64| {
            let squares: f64 = aligned.iter().zip(truth).map(|(pose, truth)| error(pose, truth).powi(2)).sum();
            (squares / count).sqrt()
        };
        Self {
            distance_m: root_mean_square(&|pose, truth| (pose.x_m - truth.x_m).hypot(pose.y_m - truth.y_m)),
            heading_rad: root_mean_square(&|pose, truth| wrapped(pose.yaw_rad - truth.yaw_rad)),
        }
    }
}

impl Drive {
    /// The true pose of each scan in the map frame, whose origin is the first.
    #[must_use]
    pub fn true_poses(&self) -> Vec<Pose> {
        let start = self.scans.first().map_or_else(Pose::default, |scan| scan.truth.pose);
        self.scans.iter().map(|scan| relative(&start, &scan.truth.pose)).collect()
    }

    /// The pose of each scan by odometry.
    #[must_use]
    pub fn odometry(&self) -> Vec<Pose> {
        self.scans.iter().map(|scan| scan.scan.pose).collect()
    }

    /// The same drive mapped by these poses, one for each scan, laid rigidly on the true ones: the truth is in the map frame.
    #[must_use]
    pub fn placed(&self, poses: &[Pose]) -> Self {
        let mut placed = self.clone();
        for (scan, pose) in placed.scans.iter_mut().zip(aligned(poses, &self.true_poses())) {
            scan.placed = Some(pose);
        }
        placed
    }
}

fn relative(from: &Pose, to: &Pose) -> Pose {
    let (sin, cos) = from.yaw_rad.sin_cos();
    let (dx, dy) = (to.x_m - from.x_m, to.y_m - from.y_m);
    Pose::new(cos * dx + sin * dy, cos * dy - sin * dx, to.yaw_rad - from.yaw_rad)
}

/// The poses moved as a rigid body to where the squares of their distances from the true ones are least.
fn aligned(poses: &[Pose], truth: &[Pose]) -> Vec<Pose> {
    let (from, to) = (mean_m(poses), mean_m(truth));
    let (mut cos, mut sin) = (0.0, 0.0);
    for (pose, target) in poses.iter().zip(truth) {
        let (p, t) = ([pose.x_m - from[0], pose.y_m - from[1]], [target.x_m - to[0], target.y_m - to[1]]);
        cos += p[0] * t[0] + p[1] * t[1];
        sin += p[0] * t[1] - p[1] * t[0];
    }
    let turn = Pose::new(0.0, 0.0, sin.atan2(cos));
    let centre = turn.then(&Pose::new(from[0], from[1], 0.0));
    let motion = Pose::new(to[0] - centre.x_m, to[1] - centre.y_m, turn.yaw_rad);
    poses.iter().map(|pose| motion.then(pose)).collect()
}

fn mean_m(poses: &[Pose]) -> [f64; 2] {
    let count = poses.len().max(1) as f64;
    let sum = |coordinate: fn(&Pose) -> f64| poses.iter().map(coordinate).sum::<f64>() / count;
    [sum(|pose| pose.x_m), sum(|pose| pose.y_m)]
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "tests fail by panicking")]
    use super::*;

    fn square() -> Vec<Pose> {
        [(0.0, 0.0), (2.0, 0.0), (2.0, 2.0), (0.0, 2.0)].map(|(x, y)| Pose::new(x, y, 0.5)).into()
    }

    #[test]
    fn a_trajectory_that_is_moved_as_a_whole_has_no_error() {
        let motion = Pose::new(5.0, -3.0, 2.0);
        let moved: Vec<Pose> = square().iter().map(|pose| motion.then(pose)).collect();
        let error = TrajectoryError::of(&moved, &square());
        assert!(error.distance_m < 1e-12 && error.heading_rad < 1e-12, "{error:?}");
    }

    #[test]
    fn errors_are_root_mean_squares() {
        // Larger by a tenth about the centre: each corner, at √2 m, is off by a tenth of that.
        let larger: Vec<Pose> = square().iter().map(|pose| Pose::new(1.1 * pose.x_m, 1.1 * pose.y_m, 0.6)).collect();
        let error = TrajectoryError::of(&larger, &square());
        assert!((error.distance_m - 0.1 * 2.0_f64.sqrt()).abs() < 1e-12 && (error.heading_rad - 0.1).abs() < 1e-12, "{error:?}");
    }
}
