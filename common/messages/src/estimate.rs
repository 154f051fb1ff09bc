//! `robot/estimate` and `trajectory/revision`: where the robot is and was in the map, as localisation estimates it.

use crate::layout::plain;
use crate::numbered::numbered;
use crate::service::{at_most, within};
use crate::{Invalid, Pose};

/// Most smoothed poses in one estimate: at 10 scans a second one leaves the horizon with each scan. More wait for the next estimate.
///
/// ```
/// use stillmap_messages::{MAX_SMOOTHED, RobotEstimate};
///
/// assert_eq!(RobotEstimate::default().smoothed.len(), MAX_SMOOTHED);
/// ```
pub const MAX_SMOOTHED: usize = 8;
/// Most stretches in one piece of a revision.
///
/// ```
/// use stillmap_messages::{MAX_MOVED, TrajectoryRevision};
///
/// assert_eq!(TrajectoryRevision::default().moved.len(), MAX_MOVED);
/// ```
pub const MAX_MOVED: usize = 32;

numbered! {
    /// How well the place of the robot in the map is known.
    ///
    /// ```
    /// use stillmap_messages::{EstimateStatus, RobotEstimate};
    ///
    /// assert_eq!(EstimateStatus::from_number(RobotEstimate::default().status), Some(EstimateStatus::Odometry));
    /// ```
    pub enum EstimateStatus {
        /// No wall was measured yet: the map frame is the odometry's.
        Odometry = 0,
        /// It follows from odometry and walls.
        Tracking = 1,
        /// Something other than its wheels moved the robot. Its place is unknown until it is recognised.
        Lost = 2,
    }
}

plain! {
    /// The pose of a scan as it enters the map: estimated from the scans after it, too.
    ///
    /// ```
    /// use stillmap_messages::{Pose, SmoothedPose};
    ///
    /// let smoothed = SmoothedPose { seq: 12, map_from_robot: Pose::new(1.0, 2.0, 0.0), is_placed: 1, reserved: 0 };
    /// assert_eq!(smoothed.seq, 12);
    /// ```
    pub struct SmoothedPose {
        /// Number of the scan.
        pub seq: u64,
        /// The robot in the map frame when it sent the scan.
        pub map_from_robot: Pose,
        /// 1 when the pose is known; 0 while the robot is lost: the scan is left out of the map until a revision moves it.
        pub is_placed: u32,
        /// Always 0.
        pub reserved: u32,
    }

    /// Where the robot is in the map at the scan of the same number.
    ///
    /// ```
    /// use stillmap_messages::{Payload, Pose, RobotEstimate, SmoothedPose};
    ///
    /// let mut estimate = RobotEstimate { map_from_odom: Pose::new(0.1, 0.0, 0.01), count: 1, ..RobotEstimate::default() };
    /// estimate.smoothed[0] = SmoothedPose { seq: 12, is_placed: 1, ..SmoothedPose::default() };
    /// assert_eq!((estimate.smoothed().len(), estimate.validate()), (1, Ok(())));
    /// ```
    pub struct RobotEstimate {
        /// The odometry frame in the map frame.
        pub map_from_odom: Pose,
        /// The scans whose poses leave the commit horizon, in ascending order; the first `count` are valid, the rest is zero.
        pub smoothed: [SmoothedPose; MAX_SMOOTHED] => count,
        /// Share by which the wheels count distances too long.
        pub distance_share: f64,
        /// Share by which the wheels count turns too large.
        pub turn_share: f64,
        /// Angle by which the wheels count a straight path as a left turn, rad/m.
        pub curvature_rad_m: f64,
        /// Number of the last piece on `trajectory/revision` that belongs to this estimate or to one before. A reader that integrates
        /// scans takes these pieces after this estimate and before the next.
        pub pieces: u64,
        /// Number of poses in `smoothed`.
        pub count: u32,
        /// [`EstimateStatus`] as a number.
        pub status: u32,
        /// Walls of which the estimate makes use.
        pub walls: u32,
        /// Places that the robot recognised so far.
        pub closures: u32,
    }

    /// A stretch of the trajectory that a revision moves as a rigid body.
    ///
    /// ```
    /// use stillmap_messages::{MovedStretch, Pose};
    ///
    /// // Scans 3 to 40 move by 10 cm.
    /// let moved = MovedStretch { first: 3, last: 40, before: Pose::default(), now: Pose::new(0.1, 0.0, 0.0) };
    /// assert_eq!(moved.last - moved.first, 37);
    /// ```
    pub struct MovedStretch {
        /// Number of its first scan.
        pub first: u64,
        /// Number of its last scan.
        pub last: u64,
        /// The robot at the first scan in the map frame, before the revision.
        pub before: Pose,
        /// The robot at the first scan in the map frame from now on. Each later scan of the stretch keeps its pose relative to it.
        pub now: Pose,
    }

    /// A piece of a revision: poses that were published as smoothed before and are now estimated otherwise, because the robot
    /// recognised a place. The pieces of all revisions are numbered as one stream.
    ///
    /// ```
    /// use stillmap_messages::{MovedStretch, TrajectoryRevision};
    ///
    /// let mut piece = TrajectoryRevision { revision: 1, is_last: 1, count: 1, ..TrajectoryRevision::default() };
    /// piece.moved[0] = MovedStretch { first: 3, last: 40, ..MovedStretch::default() };
    /// assert_eq!(piece.moved().len(), 1);
    /// ```
    pub struct TrajectoryRevision {
        /// The stretches, in ascending order of their scans; the first `count` are valid, the rest is zero.
        pub moved: [MovedStretch; MAX_MOVED] => count,
        /// Number of stretches in this piece.
        pub count: u32,
        /// Number of the revision, from 1.
        pub revision: u32,
        /// 1 for the last piece of the revision, otherwise 0. A revision counts once all of its pieces are there.
        pub is_last: u32,
        /// Always 0.
        pub reserved: u32,
    }
}

impl RobotEstimate {
    /// The smoothed poses of this estimate.
    #[must_use]
    pub fn smoothed(&self) -> &[SmoothedPose] {
        &self.smoothed[..(self.count as usize).min(MAX_SMOOTHED)]
    }

    pub(crate) fn check(&self) -> Result<(), Invalid> {
        self.map_from_odom.validate()?;
        at_most("count", self.count, MAX_SMOOTHED, "at most 8")?;
        for smoothed in self.smoothed() {
            smoothed.map_from_robot.validate()?;
            at_most("smoothed.is_placed", smoothed.is_placed, 1, "0 or 1")?;
        }
        within("distance_share", self.distance_share, -1.0, 1.0, "−1 to 1")?;
        within("turn_share", self.turn_share, -1.0, 1.0, "−1 to 1")?;
        within("curvature_rad_m", self.curvature_rad_m, -1.0, 1.0, "−1 to 1 rad/m")?;
        at_most("status", self.status, EstimateStatus::Lost as usize, "0 to 2")
    }
}

impl TrajectoryRevision {
    /// The stretches of this piece.
    #[must_use]
    pub fn moved(&self) -> &[MovedStretch] {
        &self.moved[..(self.count as usize).min(MAX_MOVED)]
    }

    pub(crate) fn check(&self) -> Result<(), Invalid> {
        at_most("count", self.count, MAX_MOVED, "at most 32")?;
        at_most("is_last", self.is_last, 1, "0 or 1")?;
        for moved in self.moved() {
            moved.before.validate()?;
            moved.now.validate()?;
        }
        Ok(())
    }
}
