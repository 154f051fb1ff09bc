//! Pictures and masks of the camera, as the page receives them.

use messages::{FrameLayout, PixelFormat};
use tungstenite::Message;

/// Widest picture that is sent, px: the page shows no wider one, and a phone's connection has to carry it.
const WIDEST: usize = 320;
/// First byte of a message with a picture.
const PICTURE: u8 = 3;
/// First byte of a message with a mask.
const MASK: u8 = 4;

/// A picture: `[3, bytes of a pixel, 0, 0]`, width and height as u16, then the pixels, grey or red, green, blue.
#[must_use]
pub(crate) fn picture(layout: FrameLayout, format: PixelFormat, bytes: &[u8]) -> Message {
    let channels = if format == PixelFormat::Rgb { 3 } else { 1 };
    message([PICTURE, channels], layout, bytes, |row, u| match format {
        PixelFormat::Grey => row.get(u..=u),
        // Y0 U Y1 V: every other byte is a pixel's luminance.
        PixelFormat::Yuyv => row.get(2 * u..=2 * u),
        PixelFormat::Rgb => row.get(3 * u..3 * u + 3),
    })
}

/// A mask: `[4, 1, 0, 0]`, width and height as u16, then a byte a pixel, above 0 where something moves.
#[must_use]
pub(crate) fn mask(layout: FrameLayout, bytes: &[u8]) -> Message {
    message([MASK, 1], layout, bytes, |row, u| row.get(u..=u))
}

/// Subsamples rows and columns until the picture is narrow enough.
fn message(head: [u8; 2], layout: FrameLayout, bytes: &[u8], pixel: impl Fn(&[u8], usize) -> Option<&[u8]>) -> Message {
    let (width, height, stride) = (layout.width as usize, layout.height as usize, layout.stride as usize);
    let factor = width.div_ceil(WIDEST).max(1);
    let (columns, rows) = (width.div_ceil(factor), height.div_ceil(factor));
    let mut out = vec![head[0], head[1], 0, 0];
    out.extend((columns as u16).to_le_bytes());
    out.extend((rows as u16).to_le_bytes());
    for row in bytes.chunks(stride.max(1)).take(height).step_by(factor) {
        out.extend((0..width).step_by(factor).filter_map(|u| pixel(row, u)).flatten());
    }
    // Missing pixels of a truncated picture are black.
    out.resize(8 + columns * rows * usize::from(head[1]), 0);
    Message::Binary(out.into())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn layout(width: u32, height: u32, stride: u32) -> FrameLayout {
        FrameLayout { width, height, stride, format: 0 }
    }

    #[test]
    fn every_format_becomes_pixels_without_padding() {
        let bytes = |message: Message| message.into_data().to_vec();
        let head = |kind, channels| vec![kind, channels, 0, 0, 2, 0, 2, 0];
        let grey = picture(layout(2, 2, 3), PixelFormat::Grey, &[1, 2, 99, 3, 4]);
        assert_eq!(bytes(grey), [head(3, 1), vec![1, 2, 3, 4]].concat());
        let yuyv = picture(layout(2, 2, 4), PixelFormat::Yuyv, &[1, 99, 2, 99, 3, 99, 4, 99]);
        assert_eq!(bytes(yuyv), [head(3, 1), vec![1, 2, 3, 4]].concat());
        let rgb = picture(layout(2, 2, 6), PixelFormat::Rgb, &(0..12).collect::<Vec<u8>>());
        assert_eq!(bytes(rgb), [head(3, 3), (0..12).collect()].concat());
        assert_eq!(bytes(mask(layout(2, 2, 2), &[0, 255])), [head(4, 1), vec![0, 255, 0, 0]].concat(), "missing pixels are black");
    }

    #[test]
    fn a_wide_picture_is_subsampled() {
        let wide: Vec<u8> = (0..640 * 4).map(|index| (index % 640 / 4) as u8).collect();
        let data = picture(layout(640, 4, 640), PixelFormat::Grey, &wide).into_data();
        assert_eq!(data[4..8], [64, 1, 2, 0], "320 × 2");
        assert_eq!((data.len(), data[8 + 100]), (8 + 640, 50));
    }
}
