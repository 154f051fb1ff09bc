//! `truth/…`: what the simulator knows and only the evaluation reads.

use crate::layout::plain;
use crate::service::{at_most, within};
use crate::{Invalid, MAX_READINGS, Pose};

/// Most surfaces in one piece of the world.
pub const MAX_SURFACES_PER_CHUNK: usize = 64;

/// Most walkers in one packet's truth.
pub const MAX_TRUE_WALKERS: usize = 16;

/// What an echo came from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u32)]
pub enum EchoLabel {
    /// Nothing came back.
    NoEcho = 0,
    /// Something that stands still.
    Still = 1,
    /// A walker.
    Walker = 2,
    /// A mirrored or multiple path: the range belongs to no surface in that direction.
    Ghost = 3,
    /// Another sonar's ping.
    Crosstalk = 4,
}

plain! {
    /// One reading with what it came from.
    pub struct TrueReading {
        /// The range as it is sent, m; the sensor's limit when nothing came back.
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

    /// The truth behind one status packet: its sequence number counts the packets sent since the robot was opened.
    pub struct TruthScan {
        /// The robot, true, in the world's frame.
        pub pose: Pose,
        /// The robot as its odometry says, in the frame of its start.
        pub odometry: Pose,
        /// The first `count` entries are readings, the rest is zero.
        pub readings: [TrueReading; MAX_READINGS] => count,
        /// x and y of each walker in the world's frame, m; the first `walkers_count` are valid.
        pub walkers_m: [[f64; 2]; MAX_TRUE_WALKERS] => walkers_count,
        /// Number of readings.
        pub count: u32,
        /// Number of walkers.
        pub walkers_count: u32,
    }

    /// A straight piece of a surface that stands still, in the world's frame.
    pub struct Surface {
        /// Its start, m.
        pub from_m: [f64; 2],
        /// Its end, m.
        pub to_m: [f64; 2],
    }

    /// A piece of the list of true surfaces.
    pub struct TruthSurfaces {
        /// Where the robot starts in the world's frame: the map's origin.
        pub start: Pose,
        /// The first `count` entries are surfaces, the rest is zero.
        pub surfaces: [Surface; MAX_SURFACES_PER_CHUNK] => count,
        /// Number of the first surface of this piece.
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
