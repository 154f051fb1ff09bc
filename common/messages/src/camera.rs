//! `camera/frame`: pictures, as bytes behind a header.

use crate::layout::plain;
use crate::{Header, Invalid, Qos, Service};

/// Largest picture on the bus: 640 × 480 in three bytes a pixel.
pub const MAX_FRAME_BYTES: usize = 640 * 480 * 3;

/// The service of camera pictures; its payload is a slice of bytes under a [`FrameHeader`].
pub const FRAME_SERVICE: Service = Service {
    name: "camera/frame",
    version: 1,
    qos: Qos { history: 4, buffer: 64, publishers: 3, subscribers: 8 },
    wakes: true,
    sequenced: true,
};

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
        let needed = self.stride as usize * (self.height as usize - 1) + row;
        within("bytes", bytes as f64, needed as f64, MAX_FRAME_BYTES as f64, "stride × (height − 1) + a row")?;
        Ok(format)
    }
}
