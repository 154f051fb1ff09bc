//! `truth/…`: the truth of a simulated drive, for the evaluation.

use crate::layout::plain;
use crate::numbered::numbered;
use crate::service::{at_most, within};
use crate::{Invalid, MAX_READINGS, Pose};

/// Most surfaces in one piece of the world.
///
/// ```
/// use stillmap_messages::{MAX_SURFACES_PER_CHUNK, TruthSurfaces};
///
/// assert_eq!(TruthSurfaces::default().surfaces.len(), MAX_SURFACES_PER_CHUNK);
/// ```
pub const MAX_SURFACES_PER_CHUNK: usize = 64;

/// Most walkers in the truth of one scan.
///
/// ```
/// use stillmap_messages::{MAX_TRUE_WALKERS, TruthScan};
///
/// assert_eq!(TruthScan::default().walkers_m.len(), MAX_TRUE_WALKERS);
/// ```
pub const MAX_TRUE_WALKERS: usize = 16;

numbered! {
    /// Cause of an echo.
    ///
    /// ```
    /// use stillmap_messages::EchoLabel;
    ///
    /// assert_eq!(EchoLabel::from_number(2), Some(EchoLabel::Walker));
    /// ```
    pub enum EchoLabel {
        /// No echo.
        NoEcho = 0,
        /// A static surface.
        Still = 1,
        /// A walker.
        Walker = 2,
        /// A mirrored or multiple path: no surface in that direction has this range.
        Ghost = 3,
        /// Another sonar's ping.
        Crosstalk = 4,
    }
}

plain! {
    /// A reading with its cause.
    ///
    /// ```
    /// use stillmap_messages::{EchoLabel, TrueReading};
    ///
    /// let reading = TrueReading { range_m: 1.4, sonar: 3, label: EchoLabel::Walker as u32, walker: 1, reserved: 0 };
    /// assert_eq!(reading.walker, 1);
    /// ```
    pub struct TrueReading {
        /// The range as it is sent, m; the limit of the sensor without an echo.
        pub range_m: f64,
        /// The sonar's number, from 0.
        pub sonar: u32,
        /// [`EchoLabel`] as a number.
        pub label: u32,
        /// Number of the walker from 1; 0 when none.
        pub walker: u32,
        /// Always 0.
        pub reserved: u32,
    }

    /// The truth of one scan. Its sequence number counts the packets since the robot was opened.
    ///
    /// ```
    /// use stillmap_messages::{Payload, TruthScan};
    ///
    /// let mut truth = TruthScan { walkers_count: 1, ..TruthScan::default() };
    /// truth.walkers_m[0] = [4.0, 1.5];
    /// assert_eq!(truth.validate(), Ok(()));
    /// ```
    pub struct TruthScan {
        /// True pose of the robot in the world frame.
        pub pose: Pose,
        /// Pose of the robot by its odometry, in the frame of its start.
        pub odometry: Pose,
        /// The first `count` entries are readings, the rest is zero.
        pub readings: [TrueReading; MAX_READINGS] => count,
        /// x and y of each walker in the world frame, m; the first `walkers_count` are valid.
        pub walkers_m: [[f64; 2]; MAX_TRUE_WALKERS] => walkers_count,
        /// Number of readings.
        pub count: u32,
        /// Number of walkers.
        pub walkers_count: u32,
    }

    /// A straight piece of a static surface, in the world frame.
    ///
    /// ```
    /// use stillmap_messages::Surface;
    ///
    /// let wall = Surface { from_m: [0.0, 0.0], to_m: [8.0, 0.0] };
    /// assert_eq!(wall.to_m[0] - wall.from_m[0], 8.0);
    /// ```
    pub struct Surface {
        /// Its start, m.
        pub from_m: [f64; 2],
        /// Its end, m.
        pub to_m: [f64; 2],
    }

    /// A piece of the list of true surfaces.
    ///
    /// ```
    /// use stillmap_messages::{Surface, TruthSurfaces};
    ///
    /// let mut piece = TruthSurfaces { total: 1, count: 1, ..TruthSurfaces::default() };
    /// piece.surfaces[0] = Surface { from_m: [0.0, 0.0], to_m: [8.0, 0.0] };
    /// ```
    pub struct TruthSurfaces {
        /// Pose of the robot at the start in the world frame: the origin of the map.
        pub start: Pose,
        /// The first `count` entries are surfaces, the rest is zero.
        pub surfaces: [Surface; MAX_SURFACES_PER_CHUNK] => count,
        /// Index of the first surface of this piece.
        pub first: u32,
        /// Surfaces of the whole world.
        pub total: u32,
        /// Number of surfaces in this piece.
        pub count: u32,
        /// Always 0.
        pub reserved: u32,
    }
}

impl TruthScan {
    pub(crate) fn check(&self) -> Result<(), Invalid> {
        self.pose.validate()?;
        self.odometry.validate()?;
        at_most("count", self.count, MAX_READINGS, "at most 16")?;
        at_most("walkers_count", self.walkers_count, MAX_TRUE_WALKERS, "at most 16")?;
        for reading in &self.readings[..self.count as usize] {
            within("readings.range_m", reading.range_m, 0.0, 10.0, "0 to 10 m")?;
            at_most("readings.label", reading.label, 4, "0 to 4")?;
        }
        for value in self.walkers_m[..self.walkers_count as usize].as_flattened() {
            within("walkers_m", *value, -1e6, 1e6, "at most 1000 km from the origin")?;
        }
        Ok(())
    }
}

impl TruthSurfaces {
    pub(crate) fn check(&self) -> Result<(), Invalid> {
        self.start.validate()?;
        at_most("count", self.count, MAX_SURFACES_PER_CHUNK, "at most 64")?;
        for surface in &self.surfaces[..self.count as usize] {
            for value in surface.from_m.iter().chain(&surface.to_m) {
                within("surfaces", *value, -1e6, 1e6, "at most 1000 km from the origin")?;
            }
        }
        Ok(())
    }
}
