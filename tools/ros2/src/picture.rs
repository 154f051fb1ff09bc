//! Pictures of a bag as the bus carries them.

use camera::{Coding, Shape};
use messages::{FrameLayout, PixelFormat};
use zune_jpeg::JpegDecoder;
use zune_jpeg::zune_core::bytestream::ZCursor;

use crate::cdr;
use crate::interfaces::{CompressedImageHead, Header, ImageHead, name};

/// The largest picture of the bus. Larger ones are shrunk by a whole number.
const MAX_WIDTH: usize = 640;
const MAX_HEIGHT: usize = 480;
/// The smallest that settings allow.
const MIN_WIDTH: usize = 80;
const MIN_HEIGHT: usize = 60;
/// The largest that is read, so that a header cannot ask for any memory: 8K.
const MAX_EDGE: u32 = 8192;

/// A picture, its rows without gaps.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Picture {
    pub(crate) header: Header,
    pub(crate) layout: FrameLayout,
    pub(crate) bytes: Vec<u8>,
}

/// Rows of pixels in a format of the bus.
struct Pixels {
    width: usize,
    height: usize,
    format: PixelFormat,
    bytes: Vec<u8>,
}

/// The picture of a message of this type; the reason if it is none that can be imported.
pub(crate) fn picture(type_name: &str, data: &[u8]) -> Result<Picture, String> {
    let (header, pixels) = if type_name == name::COMPRESSED {
        let (head, bytes) = cdr::decode_with_bytes::<CompressedImageHead>(data)?;
        (head.header, jpeg(&head.format, bytes)?)
    } else {
        let (head, bytes) = cdr::decode_with_bytes::<ImageHead>(data)?;
        let pixels = raw(&head, bytes)?;
        (head.header, pixels)
    };
    let pixels = shrink(pixels);
    if pixels.width < MIN_WIDTH || pixels.height < MIN_HEIGHT {
        return Err(format!(
            "pictures of {} × {} pixels are too small, expected at least {MIN_WIDTH} × {MIN_HEIGHT}",
            pixels.width, pixels.height
        ));
    }
    let layout = FrameLayout::packed(pixels.width as u32, pixels.height as u32, pixels.format);
    layout.validate(pixels.bytes.len()).map_err(|invalid| invalid.to_string())?;
    Ok(Picture { header, layout, bytes: pixels.bytes })
}

/// A picture without compression.
fn raw(head: &ImageHead, bytes: &[u8]) -> Result<Pixels, String> {
    let encoding = head.encoding.as_str();
    let (pixel, format): (usize, PixelFormat) = match encoding {
        "mono8" | "8UC1" => (1, PixelFormat::Grey),
        "rgb8" | "bgr8" | "8UC3" => (3, PixelFormat::Rgb),
        "rgba8" | "bgra8" | "8UC4" => (4, PixelFormat::Rgb),
        "yuyv" | "yuv422_yuy2" | "uyvy" | "yuv422" => (2, PixelFormat::Yuyv),
        _ => {
            return Err(format!(
                "pictures in {encoding:?} are not understood, expected mono8, rgb8, bgr8, rgba8, bgra8, yuyv, uyvy or JPEG"
            ));
        }
    };
    check_edges(head.width, head.height)?;
    let (width, height, step) = (head.width as usize, head.height as usize, head.step as usize);
    let row = width * pixel;
    if format == PixelFormat::Yuyv && !width.is_multiple_of(2) {
        return Err(format!("pictures in {encoding:?} of {width} columns, expected an even number"));
    }
    if step < row || bytes.len() < step * (height - 1) + row {
        return Err(format!("pictures of {} bytes, expected {height} rows of at least {row}", bytes.len()));
    }
    let swaps_colours = matches!(encoding, "bgr8" | "8UC3" | "bgra8" | "8UC4");
    let swaps_pairs = matches!(encoding, "uyvy" | "yuv422");
    let mut packed = Vec::with_capacity(height * width * format.bytes_per_pixel());
    for line in bytes.chunks(step).take(height) {
        let line = &line[..row];
        match format {
            PixelFormat::Grey => packed.extend_from_slice(line),
            PixelFormat::Rgb if swaps_colours => line.chunks_exact(pixel).for_each(|bgr| packed.extend([bgr[2], bgr[1], bgr[0]])),
            PixelFormat::Rgb => line.chunks_exact(pixel).for_each(|rgb| packed.extend([rgb[0], rgb[1], rgb[2]])),
            PixelFormat::Yuyv if swaps_pairs => line.chunks_exact(2).for_each(|pair| packed.extend([pair[1], pair[0]])),
            PixelFormat::Yuyv => packed.extend_from_slice(line),
        }
    }
    Ok(Pixels { width, height, format, bytes: packed })
}

/// The luminance of a JPEG picture, as the driver of a camera takes it.
fn jpeg(format: &str, bytes: &[u8]) -> Result<Pixels, String> {
    if !bytes.starts_with(&[0xff, 0xd8]) {
        return Err(format!("pictures in {format:?} are not understood, expected JPEG"));
    }
    let mut decoder = JpegDecoder::new(ZCursor::new(bytes));
    decoder.decode_headers().map_err(|error| format!("a JPEG picture that cannot be decoded: {error}"))?;
    let (width, height) = decoder.dimensions().unwrap_or_default();
    let edges = (u32::try_from(width).unwrap_or(u32::MAX), u32::try_from(height).unwrap_or(u32::MAX));
    check_edges(edges.0, edges.1)?;
    let shape = Shape::new(Coding::Mjpg, edges.0, edges.1, 0).map_err(|error| error.to_string())?;
    let mut luminance = vec![0; width * height];
    shape.luminance(bytes, &mut luminance).map_err(|error| format!("a JPEG picture that cannot be decoded: {error}"))?;
    Ok(Pixels { width, height, format: PixelFormat::Grey, bytes: luminance })
}

fn check_edges(width: u32, height: u32) -> Result<(), String> {
    if (1..=MAX_EDGE).contains(&width) && (1..=MAX_EDGE).contains(&height) {
        return Ok(());
    }
    Err(format!("pictures of {width} × {height} pixels, expected 1 to {MAX_EDGE} each"))
}

/// The picture in the size of the bus: each of its pixels is the mean of a square. Of YUYV the luminance remains.
fn shrink(pixels: Pixels) -> Pixels {
    let factor = pixels.width.div_ceil(MAX_WIDTH).max(pixels.height.div_ceil(MAX_HEIGHT));
    if factor <= 1 {
        return pixels;
    }
    let (channels, step, format) = match pixels.format {
        PixelFormat::Grey => (1, 1, PixelFormat::Grey),
        PixelFormat::Yuyv => (1, 2, PixelFormat::Grey),
        PixelFormat::Rgb => (3, 3, PixelFormat::Rgb),
    };
    let (width, height) = (pixels.width / factor, pixels.height / factor);
    let area = (factor * factor) as u32;
    let mut bytes = Vec::with_capacity(width * height * channels);
    for (row, column, channel) in indices(height, width, channels) {
        let square = (0..factor).flat_map(|y| (0..factor).map(move |x| (row * factor + y, column * factor + x)));
        let sum: u32 = square.map(|(y, x)| u32::from(pixels.bytes[(y * pixels.width + x) * step + channel])).sum();
        bytes.push(((sum + area / 2) / area) as u8);
    }
    Pixels { width, height, format, bytes }
}

fn indices(height: usize, width: usize, channels: usize) -> impl Iterator<Item = (usize, usize, usize)> {
    (0..height).flat_map(move |row| (0..width).flat_map(move |column| (0..channels).map(move |channel| (row, column, channel))))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn image(encoding: &str, width: u32, height: u32, step: u32, bytes: &[u8]) -> Result<Picture, String> {
        let head = ImageHead { header: Header::default(), height, width, encoding: encoding.to_owned(), is_bigendian: 0, step };
        picture(name::IMAGE, &cdr::encode_with_bytes(&head, bytes))
    }

    fn check(encoding: &str, pixel: &[u8], expect: (PixelFormat, &[u8])) {
        let row: Vec<u8> =
            pixel.iter().copied().cycle().take(80 * pixel.len() / if expect.0 == PixelFormat::Yuyv { 2 } else { 1 }).collect();
        // Two bytes between the rows.
        let rows = [row.as_slice(), &[9, 9]].concat().repeat(60);
        let found = image(encoding, 80, 60, row.len() as u32 + 2, &rows).unwrap();
        assert_eq!((found.layout, found.bytes.len()), (FrameLayout::packed(80, 60, expect.0), found.layout.bytes()));
        assert!(found.bytes.chunks(expect.1.len()).all(|pixel| pixel == expect.1), "{encoding}");
    }

    #[test]
    fn every_encoding_becomes_one_of_the_bus() {
        check("mono8", &[7], (PixelFormat::Grey, &[7]));
        check("rgb8", &[1, 2, 3], (PixelFormat::Rgb, &[1, 2, 3]));
        check("bgr8", &[1, 2, 3], (PixelFormat::Rgb, &[3, 2, 1]));
        check("rgba8", &[1, 2, 3, 4], (PixelFormat::Rgb, &[1, 2, 3]));
        check("bgra8", &[1, 2, 3, 4], (PixelFormat::Rgb, &[3, 2, 1]));
        check("yuv422_yuy2", &[1, 2, 3, 4], (PixelFormat::Yuyv, &[1, 2, 3, 4]));
        check("uyvy", &[2, 1, 4, 3], (PixelFormat::Yuyv, &[1, 2, 3, 4]));
    }

    #[test]
    fn a_large_picture_is_shrunk_by_a_whole_number() {
        let bytes: Vec<u8> = (0..720).flat_map(|_| (0..1280).map(|x| if x % 2 == 0 { 10 } else { 21 })).collect();
        let found = image("mono8", 1280, 720, 1280, &bytes).unwrap();
        assert_eq!(found.layout, FrameLayout::packed(640, 360, PixelFormat::Grey));
        assert!(found.bytes.iter().all(|pixel| *pixel == 16), "the mean of 10 and 21");
    }

    #[test]
    fn what_is_no_picture_is_refused_with_its_reason() {
        let refused = |encoding: &str, width, height, step, bytes: &[u8]| image(encoding, width, height, step, bytes).unwrap_err();
        assert!(refused("16UC1", 80, 60, 160, &[0; 9600]).starts_with("pictures in \"16UC1\" are not understood"));
        assert!(refused("mono8", 80, 60, 80, &[0; 4799]).contains("4799 bytes, expected 60 rows of at least 80"));
        assert!(refused("mono8", 80, 60, 79, &[0; 4800]).contains("expected 60 rows of at least 80"));
        assert!(refused("mono8", u32::MAX, u32::MAX, 1, &[]).contains("expected 1 to 8192 each"));
        assert!(refused("mono8", 0, 60, 80, &[]).contains("expected 1 to 8192 each"));
        assert!(refused("mono8", 40, 30, 40, &[0; 1200]).contains("too small"));
        let head = CompressedImageHead { header: Header::default(), format: "png".to_owned() };
        let refused = |bytes: &[u8]| picture(name::COMPRESSED, &cdr::encode_with_bytes(&head, bytes)).unwrap_err();
        assert_eq!(refused(b"\x89PNG"), "pictures in \"png\" are not understood, expected JPEG");
        assert!(refused(&[0xff, 0xd8, 0xff]).starts_with("a JPEG picture that cannot be decoded"));
    }
}
