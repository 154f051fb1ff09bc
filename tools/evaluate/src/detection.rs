//! STD's answers and FTI's tracks against the truth.

use messages::{SonarMotion, seconds};
use serde::Serialize;

use crate::drive::Drive;
use crate::judge::of_walker;
use crate::truth::in_map;

/// How well STD tells walkers, echo by echo.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
pub struct Detection {
    /// Echoes of walkers within the sonars that take part.
    pub walker_echoes: usize,
    /// Of these, in a mover.
    pub detected: usize,
    /// Echoes in a mover.
    pub reported: usize,
    /// Movers without an echo of a walker.
    pub false_alarms: usize,
    /// Time of the drive, minutes.
    pub minutes: f64,
}

impl Detection {
    /// Both counts together.
    #[must_use]
    pub fn with(&self, other: &Self) -> Self {
        Self {
            walker_echoes: self.walker_echoes + other.walker_echoes,
            detected: self.detected + other.detected,
            reported: self.reported + other.reported,
            false_alarms: self.false_alarms + other.false_alarms,
            minutes: self.minutes + other.minutes,
        }
    }

    /// Counts STD's answers; sonars that look further aside than `aside_rad` take no part.
    #[must_use]
    pub fn count(drive: &Drive, motions: &[SonarMotion], aside_rad: f64) -> Self {
        let (first, last) = (drive.scans.first(), drive.scans.last());
        let span_ns = first.zip(last).map_or(0, |(first, last)| last.stamp_ns.saturating_sub(first.stamp_ns));
        let mut detection = Self { minutes: seconds(span_ns) / 60.0, ..Self::default() };
        for (scan, motion) in drive.scans.iter().zip(motions) {
            let readings = scan.scan.readings().iter().zip(&scan.truth.readings).enumerate();
            let mut walkers = 0u32;
            for (index, (_, truth)) in readings.filter(|(_, (reading, _))| reading.echo != 0 && reading.mount.yaw_rad.abs() <= aside_rad) {
                let reported = motion.movers().iter().any(|mover| mover.readings & (1 << index) != 0);
                walkers |= u32::from(of_walker(truth)) << index;
                detection.walker_echoes += usize::from(of_walker(truth));
                detection.detected += usize::from(reported && of_walker(truth));
                detection.reported += usize::from(reported);
            }
            detection.false_alarms += motion.movers().iter().filter(|mover| mover.readings & walkers == 0).count();
        }
        detection
    }
}

/// Distances of the walkers' true places from the nearest track, m, for walkers within `reach_m` before the robot.
#[must_use]
pub fn track_errors_m(drive: &Drive, tracks_m: &[Vec<[f64; 2]>], reach_m: f64) -> Vec<f64> {
    let mut errors = Vec::new();
    for (scan, tracks) in drive.scans.iter().zip(tracks_m) {
        let robot = &scan.truth.pose;
        for walker in &scan.truth.walkers_m[..scan.truth.walkers_count as usize] {
            let [ahead, aside] = in_map(robot, *walker);
            if ahead <= 0.0 || aside.abs() > 0.6 * ahead || ahead.hypot(aside) > reach_m {
                continue;
            }
            let odometry = &scan.truth.odometry;
            let place = odometry.then(&messages::Pose { x_m: ahead, y_m: aside, yaw_rad: 0.0 });
            let distances = tracks.iter().map(|track| (track[0] - place.x_m).hypot(track[1] - place.y_m));
            let nearest = distances.fold(f64::INFINITY, f64::min);
            if nearest.is_finite() {
                errors.push(nearest);
            }
        }
    }
    errors
}
