//! `camera/…` and `truth/mask`: pictures, as bytes behind a header.

use crate::layout::plain;
use crate::{Header, Invalid};

/// Largest picture on the bus: 640 × 480 in three bytes a pixel.
pub const MAX_FRAME_BYTES: usize = 640 * 480 * 3;

/// `camera/frame`: what the camera sees. Memory is what limits its history: at 640 × 480 in RGB the buffer is 37 MB.
#[derive(Debug)]
pub enum CameraFrame {}

/// `camera/mask`: what SBS takes for moving in the frame of the same number, 255 where something moves; published while
/// someone listens.
#[derive(Debug)]
pub enum CameraMask {}

/// `camera/background`: what SBS takes for the picture without what moves; published while someone listens.
#[derive(Debug)]
pub enum CameraBackground {}

/// `truth/mask`: what the frame of the same number really shows, from a simulator, in the labels of the ChangeDetection
/// benchmark: 0 what stands still, 50 shadow of a walker, 170 edge of a walker, 255 a walker.
#[derive(Debug)]
pub enum TruthMask {}

/// How a pixel is stored.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u32)]
pub enum PixelFormat {
    /// One byte of luminance.
    Grey = 0,
    /// Two pixels in four bytes: Y0 U Y1 V.
    Yuyv = 1,
    /// Red, green, blue.
    Rgb = 2,
}

impl PixelFormat {
    /// The format a number stands for, if any.
    #[must_use]
    pub fn from_number(number: u32) -> Option<Self> {
        match number {
            0 => Some(Self::Grey),
            1 => Some(Self::Yuyv),
            2 => Some(Self::Rgb),
            _ => None,
        }
    }

    /// Bytes of one pixel.
    #[must_use]
    pub fn bytes_per_pixel(self) -> usize {
        match self {
            Self::Grey => 1,
            Self::Yuyv => 2,
            Self::Rgb => 3,
        }
    }
}

plain! {
    /// The shape of a picture.
    pub struct FrameLayout {
        /// Pixels in a row.
        pub width: u32,
        /// Rows.
        pub height: u32,
        /// Bytes from one row to the next.
        pub stride: u32,
        /// [`PixelFormat`] as a number.
        pub format: u32,
    }

    /// The header of a picture.
    pub struct FrameHeader {
        /// As on every message.
        pub header: Header,
        /// The shape of the bytes that follow.
        pub layout: FrameLayout,
    }
}

impl FrameLayout {
    /// Rows that follow each other without a gap.
    #[must_use]
    pub fn packed(width: u32, height: u32, format: PixelFormat) -> Self {
        Self { width, height, stride: width.saturating_mul(format.bytes_per_pixel() as u32), format: format as u32 }
    }

    /// Bytes of a picture of this shape: its rows with the gaps between them. A format that is none counts one byte a pixel.
    #[must_use]
    pub fn bytes(&self) -> usize {
        let pixel = PixelFormat::from_number(self.format).map_or(1, PixelFormat::bytes_per_pixel);
        let row = (self.width as usize).saturating_mul(pixel);
        let rows_above = (self.height as usize).saturating_sub(1);
        (self.stride as usize).saturating_mul(rows_above).saturating_add(row)
    }

    /// Checks the shape against the number of bytes that came with it.
    ///
    /// # Errors
    /// The first field that cannot be meant.
    pub fn validate(&self, bytes: usize) -> Result<PixelFormat, Invalid> {
        use crate::service::within;
        let format = PixelFormat::from_number(self.format).ok_or(Invalid {
            field: "format",
            found: f64::from(self.format),
            expected: "0 (grey), 1 (YUYV) or 2 (RGB)",
        })?;
        within("width", f64::from(self.width), 16.0, 640.0, "16 to 640 pixels")?;
        within("height", f64::from(self.height), 16.0, 480.0, "16 to 480 rows")?;
        let row = self.width as usize * format.bytes_per_pixel();
        within("stride", f64::from(self.stride), row as f64, 4096.0, "at least a row's bytes, at most 4096")?;
        within("bytes", bytes as f64, self.bytes() as f64, MAX_FRAME_BYTES as f64, "stride × (height − 1) + a row")?;
        Ok(format)
    }
}
