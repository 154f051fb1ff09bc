//! From a frame's bytes to its luminance, and what is no picture.

use messages::{FrameLayout, Invalid, PixelFormat};

use crate::plane::Plane;

/// Smallest and largest width, px.
pub(crate) const WIDTH_RANGE: (u32, u32) = (80, 640);
/// Smallest and largest height, px.
pub(crate) const HEIGHT_RANGE: (u32, u32) = (60, 480);

/// Why a frame was refused.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum FrameError {
    /// The header is not valid, or the bytes are not as many as it says.
    #[error("the frame's header: {0:?}")]
    Layout(Invalid),
    /// The picture is smaller or larger than SBS works on.
    #[error("a picture of {width} × {height}, expected 80 × 60 to 640 × 480")]
    Size {
        /// Width found, px.
        width: u32,
        /// Height found, px.
        height: u32,
    },
    /// All pixels have one value: a covered lens, a dead sensor.
    #[error("all pixels have the value {value}")]
    Uniform {
        /// That value.
        value: u8,
    },
    /// Too many pixels are at 0 or 255.
    #[error("{share:.2} of the pixels are at an end of the range, expected at most {limit:.2}")]
    Saturated {
        /// Share found.
        share: f64,
        /// Largest share.
        limit: f64,
    },
    /// The stamp is not after that of the last frame.
    #[error("stamp {stamp_ns} ns is not after the last frame's {last_ns} ns")]
    Time {
        /// Stamp found.
        stamp_ns: u64,
        /// Stamp of the last frame.
        last_ns: u64,
    },
}

/// Above this share of pixels at 0 or 255 a picture is refused.
const SATURATED_MAX: f64 = 0.7;

/// The luminance of a frame, 0 to 255.
///
/// # Errors
/// [`FrameError`]: layout, size, one value everywhere or saturated.
pub(crate) fn luminance(layout: &FrameLayout, bytes: &[u8]) -> Result<Plane<f32>, FrameError> {
    let format = layout.validate(bytes.len()).map_err(FrameError::Layout)?;
    let (width, height) = (layout.width, layout.height);
    let in_range = |x: u32, (low, high): (u32, u32)| (low..=high).contains(&x);
    if !in_range(width, WIDTH_RANGE) || !in_range(height, HEIGHT_RANGE) {
        return Err(FrameError::Size { width, height });
    }
    let mut picture = Plane::filled(width as usize, height as usize, 0.0);
    let row_bytes = width as usize * format.bytes_per_pixel();
    for (v, source) in bytes.chunks(layout.stride as usize).take(height as usize).enumerate() {
        let source = &source[..row_bytes.min(source.len())];
        let row = picture.row_mut(v);
        match format {
            PixelFormat::Grey => row.iter_mut().zip(source).for_each(|(y, &b)| *y = f32::from(b)),
            PixelFormat::Yuyv => row.iter_mut().zip(source.chunks_exact(2)).for_each(|(y, pair)| *y = f32::from(pair[0])),
            PixelFormat::Rgb => row.iter_mut().zip(source.chunks_exact(3)).for_each(|(y, rgb)| {
                // Rec. 601 luma.
                *y = 0.299 * f32::from(rgb[0]) + 0.587 * f32::from(rgb[1]) + 0.114 * f32::from(rgb[2]);
            }),
        }
    }
    check_values(&picture)?;
    Ok(picture)
}

fn check_values(picture: &Plane<f32>) -> Result<(), FrameError> {
    let values = picture.values();
    let first = values.first().copied().unwrap_or(0.0);
    let (mut differ, mut ends) = (0_u32, 0_u32);
    for &z in values {
        differ += u32::from((z - first).abs() > 0.5);
        ends += u32::from(!(0.5..254.5).contains(&z));
    }
    if differ == 0 {
        return Err(FrameError::Uniform { value: first as u8 });
    }
    let share = f64::from(ends) / values.len() as f64;
    if share > SATURATED_MAX { Err(FrameError::Saturated { share, limit: SATURATED_MAX }) } else { Ok(()) }
}
