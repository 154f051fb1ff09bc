//! One scan of a recorded drive.

use messages::{Pose, SonarScan, TruthScan};

/// A scan and the truth behind it.
#[derive(Debug, Clone)]
pub struct Scan {
    /// From 1.
    pub seq: u64,
    /// Since the start of the drive.
    pub stamp_ns: u64,
    /// What the robot says.
    pub scan: SonarScan,
    /// What its readings came from.
    pub truth: TruthScan,
    /// Where it enters the map, map frame, if not by its odometry.
    pub placed: Option<Pose>,
}
