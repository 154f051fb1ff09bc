//! Where the robot was, by its odometry.

use core::f64::consts::{PI, TAU};

use messages::Pose;

/// Odometry that is silent for longer tells nothing of what lies between, ns. Robots publish it ten times a second or more often.
const LONGEST_GAP_NS: u64 = 1_000_000_000;
/// A robot that maps is slower, m/s: a faster move is a reset of the odometry.
const FASTEST_M_S: f64 = 3.0;
/// A shorter move may be jitter of the stamps, m.
const SHORTEST_JUMP_M: f64 = 0.5;

/// One message of odometry.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Sample {
    pub(crate) stamp_ns: u64,
    pub(crate) pose: Pose,
    /// The robot may have moved unobserved before it.
    pub(crate) is_doubtful: bool,
}

/// What lies between a sample and the one before.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Before {
    /// A drive.
    Drive,
    /// A time without odometry.
    Gap,
    /// A move that is unknown.
    Jump,
}

/// Samples in the order of their stamps, each stamp once.
#[derive(Debug, Clone, Default)]
pub(crate) struct Trajectory(Vec<Sample>);

impl Trajectory {
    pub(crate) fn new(mut samples: Vec<Sample>) -> Self {
        samples.sort_by_key(|sample| sample.stamp_ns);
        samples.dedup_by_key(|sample| sample.stamp_ns);
        Self(samples)
    }

    pub(crate) fn samples(&self) -> &[Sample] {
        &self.0
    }

    /// What lies before the sample of this number.
    pub(crate) fn before(&self, number: usize) -> Before {
        let Some([last, next]) = number.checked_sub(1).and_then(|last| self.0.get(last..=number)) else { return Before::Drive };
        let seconds = (next.stamp_ns - last.stamp_ns) as f64 * 1e-9;
        let (x_m, y_m) = (next.pose.x_m - last.pose.x_m, next.pose.y_m - last.pose.y_m);
        let square = x_m * x_m + y_m * y_m;
        let is_fast = square > (FASTEST_M_S * seconds) * (FASTEST_M_S * seconds) && square > SHORTEST_JUMP_M * SHORTEST_JUMP_M;
        if next.is_doubtful || is_fast {
            Before::Jump
        } else if is_gap(next.stamp_ns - last.stamp_ns) {
            Before::Gap
        } else {
            Before::Drive
        }
    }

    /// The pose at a time, between the samples around it; `None` before the first, behind the last, and where the drive is unknown.
    pub(crate) fn at(&self, stamp_ns: u64) -> Option<Pose> {
        let next = self.0.partition_point(|sample| sample.stamp_ns < stamp_ns);
        let after = self.0.get(next)?;
        if after.stamp_ns == stamp_ns {
            return Some(after.pose);
        }
        let before = self.0.get(next.checked_sub(1)?).filter(|_| self.before(next) == Before::Drive)?;
        let share = (stamp_ns - before.stamp_ns) as f64 / (after.stamp_ns - before.stamp_ns) as f64;
        let turn = shortest(after.pose.yaw_rad - before.pose.yaw_rad);
        Some(Pose {
            x_m: before.pose.x_m + share * (after.pose.x_m - before.pose.x_m),
            y_m: before.pose.y_m + share * (after.pose.y_m - before.pose.y_m),
            yaw_rad: before.pose.yaw_rad + share * turn,
        })
    }
}

/// Whether so long a time without odometry is a gap.
pub(crate) fn is_gap(silent_ns: u64) -> bool {
    silent_ns > LONGEST_GAP_NS
}

/// A turn as one of at most half a circle.
fn shortest(turn_rad: f64) -> f64 {
    let turn = turn_rad % TAU;
    if turn > PI {
        turn - TAU
    } else if turn < -PI {
        turn + TAU
    } else {
        turn
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn trajectory(samples: &[(u64, f64, f64)]) -> Trajectory {
        let sample = |(ms, x_m, yaw_rad): &(u64, f64, f64)| Sample {
            stamp_ns: ms * 1_000_000,
            pose: Pose { x_m: *x_m, y_m: 0.0, yaw_rad: *yaw_rad },
            is_doubtful: false,
        };
        Trajectory::new(samples.iter().map(sample).collect())
    }

    #[test]
    fn a_pose_lies_between_those_around_it() {
        let drive = trajectory(&[(200, 0.2, -3.0), (100, 0.1, 3.0)]);
        let pose = drive.at(150_000_000).unwrap();
        assert!((pose.x_m - 0.15).abs() < 1e-12 && (pose.yaw_rad - PI).abs() < 1e-12, "{pose:?}");
        assert_eq!(drive.at(100_000_000).unwrap().yaw_rad, 3.0);
        assert_eq!((drive.at(99_999_999), drive.at(200_000_001)), (None, None));
    }

    #[test]
    fn no_pose_lies_in_a_gap_or_in_a_jump() {
        let drive = trajectory(&[(0, 0.0, 0.0), (1001, 0.2, 0.0), (1100, 0.9, 0.0), (1200, 1.1, 0.0)]);
        assert_eq!([0, 1, 2, 3].map(|number| drive.before(number)), [Before::Drive, Before::Gap, Before::Jump, Before::Drive]);
        assert_eq!([500, 1050].map(|ms| drive.at(ms * 1_000_000)), [None, None]);
        assert!(drive.at(1_150_000_000).is_some());
    }
}
