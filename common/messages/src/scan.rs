//! `robot/scan`: the new sonar readings of one status packet.

use crate::Invalid;
use crate::layout::plain;
use crate::service::{at_most, finite, within};

/// Most readings in one scan.
pub const MAX_READINGS: usize = 16;

/// [`SonarScan::after_gap`]: packets were lost before the scan, or the link was down; the pose follows from the robot's counters.
pub const AFTER_LOSS: u32 = 1;

/// [`SonarScan::after_gap`]: what the robot did before the scan is not known. From here on poses may be off against those before by
/// metres and any turn.
pub const AFTER_DOUBT: u32 = 2;

plain! {
    /// A place and direction in the plane.
    pub struct Pose {
        /// Along x of the frame, m.
        pub x_m: f64,
        /// Along y of the frame, m.
        pub y_m: f64,
        /// Counter-clockwise from the frame's x axis, rad.
        pub yaw_rad: f64,
    }

    /// One reading of one sonar.
    pub struct SonarReading {
        /// Where the transducer sits and looks, in the robot frame.
        pub mount: Pose,
        /// Distance to the echo in m; the sensor's limit when nothing came back.
        pub range_m: f64,
        /// The sonar's number on the robot, from 0.
        pub sonar: u32,
        /// 1 when an echo came back, 0 when none did.
        pub echo: u32,
    }

    /// The readings that are new since the last packet, with the odometry of that packet.
    ///
    /// A Pioneer fires its sonars in turn: a scan holds two or three readings, and sometimes none.
    pub struct SonarScan {
        /// The robot in the map frame, from odometry.
        pub pose: Pose,
        /// The first `count` entries are readings, the rest is zero.
        pub readings: [SonarReading; MAX_READINGS] => count,
        /// Number of readings, at most [`MAX_READINGS`].
        pub count: u32,
        /// 0 when nothing was lost before this scan, [`AFTER_LOSS`] when packets were lost and the pose is right all the same,
        /// [`AFTER_DOUBT`] when the robot may have moved without the odometry knowing.
        pub after_gap: u32,
    }
}

impl Pose {
    /// A place (m) and direction (rad, counter-clockwise).
    #[must_use]
    pub const fn new(x_m: f64, y_m: f64, yaw_rad: f64) -> Self {
        Self { x_m, y_m, yaw_rad }
    }

    pub(crate) fn validate(&self) -> Result<(), Invalid> {
        within("pose.x_m", self.x_m, -1e6, 1e6, "at most 1000 km from the origin")?;
        within("pose.y_m", self.y_m, -1e6, 1e6, "at most 1000 km from the origin")?;
        finite("pose.yaw_rad", self.yaw_rad)
    }

    /// This pose followed by `next`, which is given in this pose's frame: `map_from_robot.then(robot_from_sonar)`.
    #[must_use]
    pub fn then(&self, next: &Pose) -> Pose {
        let (sin, cos) = self.yaw_rad.sin_cos();
        Pose {
            x_m: self.x_m + cos * next.x_m - sin * next.y_m,
            y_m: self.y_m + sin * next.x_m + cos * next.y_m,
            yaw_rad: self.yaw_rad + next.yaw_rad,
        }
    }
}

impl SonarReading {
    /// What sonar number `sonar`, which sits and looks as `mount` says in the robot frame, has measured: the distance (m) to an
    /// echo, or the sensor's limit when there was none.
    #[must_use]
    pub const fn new(sonar: u32, mount: Pose, range_m: f64, echo: bool) -> Self {
        Self { mount, range_m, sonar, echo: echo as u32 }
    }
}

impl SonarScan {
    /// The readings of this scan.
    #[must_use]
    pub fn readings(&self) -> &[SonarReading] {
        &self.readings[..(self.count as usize).min(MAX_READINGS)]
    }

    /// Whether poses from this scan on may be off against those before.
    #[must_use]
    pub fn is_doubtful(&self) -> bool {
        self.after_gap >= AFTER_DOUBT
    }

    /// A scan of at most [`MAX_READINGS`] readings; further ones are left out.
    #[must_use]
    pub fn new(pose: Pose, readings: &[SonarReading], after_gap: bool) -> Self {
        let count = readings.len().min(MAX_READINGS);
        let mut scan = Self { pose, count: count as u32, after_gap: u32::from(after_gap), ..Self::default() };
        scan.readings[..count].copy_from_slice(&readings[..count]);
        scan
    }
}

impl SonarScan {
    pub(crate) fn check(&self) -> Result<(), Invalid> {
        self.pose.validate()?;
        at_most("count", self.count, MAX_READINGS, "at most 16")?;
        at_most("after_gap", self.after_gap, AFTER_DOUBT as usize, "0 to 2")?;
        for reading in self.readings() {
            within("readings.mount.x_m", reading.mount.x_m, -10.0, 10.0, "within 10 m of the robot")?;
            within("readings.mount.y_m", reading.mount.y_m, -10.0, 10.0, "within 10 m of the robot")?;
            within("readings.mount.yaw_rad", reading.mount.yaw_rad, -10.0, 10.0, "an angle")?;
            // No sonar of a mobile robot hears farther; it bounds the work that one reading can make.
            within("readings.range_m", reading.range_m, 0.0, 10.0, "0 to 10 m")?;
            at_most("readings.sonar", reading.sonar, 255, "at most 255")?;
            at_most("readings.echo", reading.echo, 1, "0 or 1")?;
        }
        Ok(())
    }
}
