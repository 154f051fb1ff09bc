//! `motion/sonar` and `motion/camera`: motion detected by the sonars and by the camera.

use crate::layout::plain;
use crate::numbered::numbered;
use crate::service::{at_most, finite, within};
use crate::{Invalid, MAX_READINGS};

/// Most moving classes in one answer.
///
/// ```
/// use stillmap_messages::{MAX_MOVERS, SonarMotion};
///
/// assert_eq!(SonarMotion::default().movers.len(), MAX_MOVERS);
/// ```
pub const MAX_MOVERS: usize = 16;
/// Most blobs in one answer.
///
/// ```
/// use stillmap_messages::{CameraMotion, MAX_BLOBS};
///
/// assert_eq!(CameraMotion::default().blobs.len(), MAX_BLOBS);
/// ```
pub const MAX_BLOBS: usize = 16;

plain! {
    /// A class of cells that moves (`CELL_mov` of the paper's Table 1).
    ///
    /// ```
    /// use stillmap_messages::Mover;
    ///
    /// let mover = Mover { map_x_m: 2.0, velocity_x_m_s: -0.8, cells: 40, readings: 0b101, track: 3, ..Mover::default() };
    /// assert!(mover.readings & 1 << 2 != 0, "the third reading of the scan belongs to it");
    /// ```
    pub struct Mover {
        /// Centroid in the robot frame, m.
        pub robot_x_m: f64,
        /// Centroid in the robot frame, m.
        pub robot_y_m: f64,
        /// Centroid in the odom frame, m.
        pub map_x_m: f64,
        /// Centroid in the odom frame, m.
        pub map_y_m: f64,
        /// Velocity of its track in the odom frame, m/s.
        pub velocity_x_m_s: f64,
        /// Velocity of its track in the odom frame, m/s.
        pub velocity_y_m_s: f64,
        /// Size in cells (`C_Size`).
        pub cells: u32,
        /// Bit i set: reading i of the scan belongs to it.
        pub readings: u32,
        /// Identity of its track; 0 before it has one.
        pub track: u64,
    }

    /// The answer of STD to a scan, also when nothing moves. It has the sequence number of the scan.
    ///
    /// ```
    /// use stillmap_messages::{Mover, SonarMotion};
    ///
    /// let mut motion = SonarMotion { count: 1, ..SonarMotion::default() };
    /// motion.movers[0] = Mover { map_x_m: 2.0, cells: 40, ..Mover::default() };
    /// assert_eq!(motion.movers().len(), 1);
    /// ```
    pub struct SonarMotion {
        /// The first `count` entries are movers, the rest is zero.
        pub movers: [Mover; MAX_MOVERS] => count,
        /// Number of movers.
        pub count: u32,
        /// 1 when there were more movers than fit.
        pub truncated: u32,
    }

    /// A moving region of the picture (`BLOB_mov`).
    ///
    /// ```
    /// use stillmap_messages::Blob;
    ///
    /// let blob = Blob { left_px: 10, right_px: 30, top_px: 5, bottom_px: 65, size_px: 700, u_px: 20.0, v_px: 35.0, reserved: 0 };
    /// assert_eq!((blob.right_px - blob.left_px, blob.bottom_px - blob.top_px), (20, 60));
    /// ```
    pub struct Blob {
        /// Centroid, px from the left.
        pub u_px: f32,
        /// Centroid, px from the top.
        pub v_px: f32,
        /// Area, px.
        pub size_px: u32,
        /// Left edge, px.
        pub left_px: u32,
        /// Top edge, px.
        pub top_px: u32,
        /// Right edge, px, exclusive.
        pub right_px: u32,
        /// Lowest row with its pixels, exclusive.
        pub bottom_px: u32,
        /// Always 0.
        pub reserved: u32,
    }

    /// The answer of SBS to a frame. It has the sequence number of the frame.
    ///
    /// ```
    /// use stillmap_messages::{Blob, CameraMotion, CameraStatus, Payload};
    ///
    /// let mut motion = CameraMotion { count: 1, width: 320, height: 240, status: CameraStatus::Compensated as u32, ..CameraMotion::default() };
    /// motion.transform = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0];
    /// motion.blobs[0] = Blob { left_px: 10, right_px: 30, bottom_px: 65, u_px: 20.0, v_px: 35.0, ..Blob::default() };
    /// assert_eq!(motion.validate(), Ok(()));
    /// ```
    pub struct CameraMotion {
        /// Maps a pixel of the current frame to the background frame, row by row, homogeneous (section 5.1 of the paper).
        pub transform: [f64; 9],
        /// Root mean square of the residuals of the accepted pairs, px.
        pub residual_px: f64,
        /// Share of pairs that agree with the transform.
        pub inliers: f64,
        /// The first `count` entries are blobs, the rest is zero.
        pub blobs: [Blob; MAX_BLOBS] => count,
        /// Number of blobs.
        pub count: u32,
        /// [`CameraStatus`] as a number.
        pub status: u32,
        /// Width of the frame, px.
        pub width: u32,
        /// Height of the frame, px.
        pub height: u32,
    }
}

numbered! {
    /// Result of SBS for a frame.
    ///
    /// ```
    /// use stillmap_messages::CameraStatus;
    ///
    /// assert_eq!(CameraStatus::from_number(1), Some(CameraStatus::Learning));
    /// ```
    pub enum CameraStatus {
        /// The camera motion is compensated; the blobs are what moves.
        Compensated = 0,
        /// The model is still being learned; no blobs.
        Learning = 1,
        /// The camera motion was not found; no blobs.
        NotCompensated = 2,
        /// The frame was refused (size, values or time); no blobs.
        Refused = 3,
    }
}

impl SonarMotion {
    /// The movers of this answer.
    #[must_use]
    pub fn movers(&self) -> &[Mover] {
        &self.movers[..(self.count as usize).min(MAX_MOVERS)]
    }
}

impl CameraMotion {
    /// The blobs of this answer.
    #[must_use]
    pub fn blobs(&self) -> &[Blob] {
        &self.blobs[..(self.count as usize).min(MAX_BLOBS)]
    }
}

impl SonarMotion {
    pub(crate) fn check(&self) -> Result<(), Invalid> {
        at_most("count", self.count, MAX_MOVERS, "at most 16")?;
        at_most("truncated", self.truncated, 1, "0 or 1")?;
        for mover in self.movers() {
            for value in [mover.robot_x_m, mover.robot_y_m, mover.map_x_m, mover.map_y_m] {
                within("movers.centroid", value, -1e6, 1e6, "at most 1000 km from the origin")?;
            }
            within("movers.velocity_x_m_s", mover.velocity_x_m_s, -100.0, 100.0, "at most 100 m/s")?;
            within("movers.velocity_y_m_s", mover.velocity_y_m_s, -100.0, 100.0, "at most 100 m/s")?;
            at_most("movers.readings", mover.readings, (1 << MAX_READINGS) - 1, "a bit for each of 16 readings")?;
        }
        Ok(())
    }
}

impl CameraMotion {
    pub(crate) fn check(&self) -> Result<(), Invalid> {
        at_most("count", self.count, MAX_BLOBS, "at most 16")?;
        at_most("status", self.status, 3, "0 to 3")?;
        at_most("width", self.width, 640, "at most 640")?;
        at_most("height", self.height, 480, "at most 480")?;
        within("residual_px", self.residual_px, 0.0, 1e4, "0 to 10000 px")?;
        within("inliers", self.inliers, 0.0, 1.0, "0 to 1")?;
        for value in self.transform {
            finite("transform", value)?;
        }
        for blob in self.blobs() {
            within("blobs.u_px", f64::from(blob.u_px), 0.0, f64::from(self.width), "inside the picture")?;
            within("blobs.v_px", f64::from(blob.v_px), 0.0, f64::from(self.height), "inside the picture")?;
            at_most("blobs.right_px", blob.right_px, self.width as usize, "inside the picture")?;
            at_most("blobs.bottom_px", blob.bottom_px, self.height as usize, "inside the picture")?;
            at_most("blobs.left_px", blob.left_px, blob.right_px as usize, "left of the right edge")?;
            at_most("blobs.top_px", blob.top_px, blob.bottom_px as usize, "above the bottom edge")?;
        }
        Ok(())
    }
}
