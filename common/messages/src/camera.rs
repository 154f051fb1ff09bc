//! `camera/…` and `truth/mask`: pictures, as bytes behind a header.

use crate::layout::plain;
use crate::numbered::numbered;
use crate::{Header, Invalid};

/// Largest picture on the bus: 640 × 480 in three bytes a pixel.
///
/// ```
/// use stillmap_messages::{FrameLayout, MAX_FRAME_BYTES, PixelFormat};
///
/// assert_eq!(FrameLayout::packed(640, 480, PixelFormat::Rgb).bytes(), MAX_FRAME_BYTES);
/// ```
pub const MAX_FRAME_BYTES: usize = 640 * 480 * 3;

/// `camera/frame`: pictures of the camera. Memory limits its history: at 640 × 480 in RGB the buffer is 37 MB.
///
/// ```
/// use stillmap_messages::{CameraFrame, Pictures};
///
/// assert_eq!(CameraFrame::SERVICE.name, "camera/frame");
/// ```
#[derive(Debug)]
pub enum CameraFrame {}

/// `camera/mask`: where SBS detects motion in the frame of the same number, 255 there and 0 elsewhere. It is made only while it is
/// read.
///
/// ```
/// use stillmap_messages::{CameraMask, Pictures};
///
/// assert_eq!(CameraMask::MAX_BYTES, 640 * 480);
/// ```
#[derive(Debug)]
pub enum CameraMask {}

/// `camera/background`: the picture without what moves, as SBS models it. It is made only while it is read.
///
/// ```
/// use stillmap_messages::{CameraBackground, Pictures, Recorded};
///
/// assert_eq!(CameraBackground::SERVICE.recorded, Recorded::No);
/// ```
#[derive(Debug)]
pub enum CameraBackground {}

/// `truth/mask`: the true content of the frame of the same number, from a simulator, in the labels of the ChangeDetection
/// benchmark: 0 static, 50 shadow of a walker, 170 edge of a walker, 255 walker.
///
/// ```
/// use stillmap_messages::{Pictures, TruthMask};
///
/// assert_eq!(TruthMask::SERVICE.name, "truth/mask");
/// ```
#[derive(Debug)]
pub enum TruthMask {}

numbered! {
    /// How a pixel is stored.
    ///
    /// ```
    /// use stillmap_messages::PixelFormat;
    ///
    /// assert_eq!(PixelFormat::from_number(1), Some(PixelFormat::Yuyv));
    /// assert_eq!(PixelFormat::Yuyv.bytes_per_pixel(), 2);
    /// ```
    pub enum PixelFormat {
        /// One byte of luminance.
        Grey = 0,
        /// Two pixels in four bytes: Y0 U Y1 V.
        Yuyv = 1,
        /// Red, green, blue.
        Rgb = 2,
    }
}

impl PixelFormat {
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
    /// The size and format of a picture.
    ///
    /// ```
    /// use stillmap_messages::{FrameLayout, PixelFormat};
    ///
    /// let layout = FrameLayout::packed(320, 240, PixelFormat::Grey);
    /// assert_eq!(layout.validate(320 * 240), Ok(PixelFormat::Grey));
    /// assert!(layout.validate(100).is_err(), "rows are missing");
    /// ```
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
    ///
    /// ```
    /// use stillmap_messages::{FrameHeader, FrameLayout, Header, PixelFormat};
    ///
    /// let header = Header { seq: 1, stamp_ns: 2_000, ..Header::default() };
    /// let header = FrameHeader { header, layout: FrameLayout::packed(320, 240, PixelFormat::Rgb) };
    /// assert_eq!(header.layout.stride, 960);
    /// ```
    pub struct FrameHeader {
        /// As on every message.
        pub header: Header,
        /// Size and format of the picture that follows.
        pub layout: FrameLayout,
    }
}

impl FrameLayout {
    /// Rows that follow each other without a gap.
    #[must_use]
    pub fn packed(width: u32, height: u32, format: PixelFormat) -> Self {
        Self { width, height, stride: width.saturating_mul(format.bytes_per_pixel() as u32), format: format as u32 }
    }

    /// Bytes of a picture of this shape: its rows with the gaps between them. An unknown format counts as one byte a pixel.
    #[must_use]
    pub fn bytes(&self) -> usize {
        let pixel = PixelFormat::from_number(self.format).map_or(1, PixelFormat::bytes_per_pixel);
        let row = (self.width as usize).saturating_mul(pixel);
        let rows_above = (self.height as usize).saturating_sub(1);
        (self.stride as usize).saturating_mul(rows_above).saturating_add(row)
    }

    /// Checks size and format against the number of bytes that were received.
    ///
    /// # Errors
    /// The first field that is out of range.
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
