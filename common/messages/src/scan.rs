//! `robot/scan`: the new sonar readings of one status packet.

use crate::Invalid;
use crate::layout::plain;
use crate::service::{at_most, finite, within};

/// Most readings in one scan.
///
/// ```
/// use stillmap_messages::{MAX_READINGS, SonarScan};
///
/// assert_eq!(SonarScan::default().readings.len(), MAX_READINGS);
/// ```
pub const MAX_READINGS: usize = 16;

/// Value of [`SonarScan::after_gap`]: packets were lost before the scan, or the link was down. The pose is right: it follows from
/// the robot's counters.
///
/// ```
/// use stillmap_messages::{AFTER_LOSS, SonarScan};
///
/// let scan = SonarScan { after_gap: AFTER_LOSS, ..SonarScan::default() };
/// assert!(!scan.is_doubtful());
/// ```
pub const AFTER_LOSS: u32 = 1;

/// Value of [`SonarScan::after_gap`]: the robot may have moved unobserved before the scan. Later poses may differ from earlier ones
/// by metres and any rotation.
///
/// ```
/// use stillmap_messages::{AFTER_DOUBT, SonarScan};
///
/// let scan = SonarScan { after_gap: AFTER_DOUBT, ..SonarScan::default() };
/// assert!(scan.is_doubtful());
/// ```
pub const AFTER_DOUBT: u32 = 2;

plain! {
    /// A position and direction in the plane.
    ///
    /// ```
    /// use stillmap_messages::Pose;
    ///
    /// let map_from_robot = Pose::new(1.0, 2.0, core::f64::consts::FRAC_PI_2);
    /// let robot_from_sonar = Pose::new(0.2, 0.0, 0.0);
    /// let map_from_sonar = map_from_robot.then(&robot_from_sonar);
    /// assert!((map_from_sonar.x_m - 1.0).abs() < 1e-9 && (map_from_sonar.y_m - 2.2).abs() < 1e-9);
    /// ```
    pub struct Pose {
        /// Along x of the frame, m.
        pub x_m: f64,
        /// Along y of the frame, m.
        pub y_m: f64,
        /// Counter-clockwise from the frame's x axis, rad.
        pub yaw_rad: f64,
    }

    /// One reading of one sonar.
    ///
    /// ```
    /// use stillmap_messages::{Pose, SonarReading};
    ///
    /// // Sonar 3 looks ahead from the front of the robot and has an echo at 1.4 m.
    /// let reading = SonarReading::new(3, Pose::new(0.1, 0.0, 0.0), 1.4, true);
    /// assert_eq!(reading.echo, 1);
    /// ```
    pub struct SonarReading {
        /// Position and direction of the transducer in the robot frame.
        pub mount: Pose,
        /// Distance to the echo, m; the limit of the sensor without an echo.
        pub range_m: f64,
        /// Number of the sonar on the robot, from 0.
        pub sonar: u32,
        /// 1 with an echo, 0 without.
        pub echo: u32,
    }

    /// The readings that are new since the last packet, with the odometry of that packet.
    ///
    /// A Pioneer fires its sonars in turn: a scan has two or three readings, and sometimes none.
    ///
    /// ```
    /// use stillmap_messages::{Payload, Pose, SonarReading, SonarScan};
    ///
    /// let reading = SonarReading::new(3, Pose::new(0.1, 0.0, 0.0), 1.4, true);
    /// let scan = SonarScan::new(Pose::new(0.5, 0.0, 0.0), &[reading], false);
    /// assert_eq!((scan.readings(), scan.validate()), (&[reading][..], Ok(())));
    /// ```
    pub struct SonarScan {
        /// Pose of the robot in the odom frame.
        pub pose: Pose,
        /// The first `count` entries are readings, the rest is zero.
        pub readings: [SonarReading; MAX_READINGS] => count,
        /// Number of readings.
        pub count: u32,
        /// 0 when nothing was lost before this scan; 1 ([`AFTER_LOSS`]) when packets were lost and the pose is right all the same;
        /// 2 ([`AFTER_DOUBT`]) when the robot may have moved without the odometry knowing.
        pub after_gap: u32,
    }
}

impl Pose {
    /// A position (m) and direction (rad, counter-clockwise).
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
    /// A reading of a sonar whose transducer has the pose `mount` in the robot frame: the distance (m) to an echo, or the limit of
    /// the sensor without an echo.
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

    /// Whether the robot may have moved unobserved before this scan.
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
            within("readings.mount.yaw_rad", reading.mount.yaw_rad, -10.0, 10.0, "−10 to 10 rad")?;
            // No sonar of a mobile robot measures farther. The limit bounds the work for one reading.
            within("readings.range_m", reading.range_m, 0.0, 10.0, "0 to 10 m")?;
            at_most("readings.sonar", reading.sonar, 255, "at most 255")?;
            at_most("readings.echo", reading.echo, 1, "0 or 1")?;
        }
        Ok(())
    }
}
