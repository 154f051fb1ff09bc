//! What localisation says about a scan.

use geometry::{MapFromOdom, MapFromRobot};

/// How well the robot's place is known.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Status {
    /// Switched off, or no wall was seen yet: the map frame is the odometry's.
    #[default]
    Odometry,
    /// The robot's place follows from odometry and walls.
    Tracking,
    /// The robot was moved by something other than its wheels. Its place in the map is not known until it is recognised. Localisation
    /// does not detect this yet, and never answers it.
    Lost,
}

/// The pose of a scan as it enters the map, later than the scan by the commit horizon.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Smoothed {
    /// Number of the scan.
    pub seq: u64,
    /// The robot when it sent the scan.
    pub map_from_robot: MapFromRobot,
    /// Whether the pose is known. False while the robot is lost: the scan must not enter the map before a revision moves it.
    pub is_placed: bool,
}

/// A stretch of the drive that a revision moves as a rigid body. All its scans are placed from then on.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Moved {
    /// Number of its first scan.
    pub first: u64,
    /// Number of its last scan.
    pub last: u64,
    /// The robot at the first scan as it was answered last, in [`Smoothed`] or in an earlier revision.
    pub before: MapFromRobot,
    /// The robot at the first scan from now on.
    pub now: MapFromRobot,
}

/// A change of poses that were answered before.
#[derive(Debug, Clone, PartialEq)]
pub struct Revision {
    /// Number of the revision, from 1.
    pub number: u32,
    /// What moves, in the order of the scans. Scans that moved by at most 2 cm and 0.5° are left out.
    pub moved: Vec<Moved>,
}

/// Systematic errors of the odometry, as estimated.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Calibration {
    /// Share by which the wheels count distances too long.
    pub distance_share: f64,
    /// Share by which the wheels count turns too large.
    pub turn_share: f64,
    /// Angle by which the wheels count a straight path as a left turn, rad per metre.
    pub curvature_rad_m: f64,
}

/// A straight wall.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Wall {
    /// Both ends in the map frame, m.
    pub ends_m: [[f64; 2]; 2],
}

/// A place that the robot recognised.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Closure {
    /// The robot at the earlier visit, in the map frame, m.
    pub earlier_m: [f64; 2],
    /// The robot at the later visit, in the map frame, m.
    pub later_m: [f64; 2],
    /// Its weight in the estimate, 0 (contradicted) to 1.
    pub weight: f64,
}

/// The answer to a scan.
#[derive(Debug, Clone, PartialEq)]
pub struct Answer {
    /// The odometry's frame in the map, for the scan that is answered.
    pub map_from_odom: MapFromOdom,
    /// How well the place is known.
    pub status: Status,
    /// The scans that leave the commit horizon, in their order.
    pub smoothed: Vec<Smoothed>,
    /// What a recognised place changed. It concerns scans that were answered in [`Self::smoothed`] before or now.
    pub revision: Option<Revision>,
}
