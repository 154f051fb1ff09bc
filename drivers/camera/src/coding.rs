//! How a camera codes its pixels, and the way from there to luminance: one pass over the mapped buffer.

use zune_jpeg::JpegDecoder;
use zune_jpeg::zune_core::bytestream::ZCursor;
use zune_jpeg::zune_core::colorspace::ColorSpace;
use zune_jpeg::zune_core::options::DecoderOptions;

use crate::four_cc::FourCc;
use crate::trouble::Trouble;

/// The codings that this driver reads.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Coding {
    /// One byte of luminance a pixel.
    Grey,
    /// Two pixels in four bytes: Y0 U Y1 V.
    Yuyv,
    /// A JPEG picture a frame.
    Mjpg,
}

/// Why a frame's bytes are no picture.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum Damage {
    /// The device says so itself.
    #[error("the device marks it as damaged")]
    Marked,
    /// There are fewer bytes than the picture needs.
    #[error("{found} bytes, expected {expected}")]
    Short {
        /// Bytes that came.
        found: usize,
        /// Bytes that the picture needs.
        expected: usize,
    },
    /// It is JPEG of another size.
    #[error("a JPEG picture of {} × {}, expected {} × {}", found.0, found.1, expected.0, expected.1)]
    Size {
        /// Width and height found.
        found: (usize, usize),
        /// Those of the format.
        expected: (usize, usize),
    },
    /// It is the beginning of a JPEG picture.
    #[error("a JPEG picture of {found} bytes without its end")]
    Cut {
        /// Bytes that came.
        found: usize,
    },
    /// It is a JPEG picture with less data than its size needs.
    #[error("a JPEG picture whose data of {found} bytes is not all of it")]
    Incomplete {
        /// Bytes that came.
        found: usize,
    },
    /// It is no JPEG that can be decoded.
    #[error("JPEG: {0}")]
    Jpeg(String),
}

/// The form of a camera's pictures, as the device has said it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Shape {
    coding: Coding,
    width: u32,
    height: u32,
    stride: u32,
}

impl Coding {
    /// Every coding, the one that costs least first.
    pub const ALL: [Self; 3] = [Self::Grey, Self::Yuyv, Self::Mjpg];

    /// The kernel's name of it.
    #[must_use]
    pub fn four_cc(self) -> FourCc {
        match self {
            Self::Grey => FourCc::new(b"GREY"),
            Self::Yuyv => FourCc::new(b"YUYV"),
            Self::Mjpg => FourCc::new(b"MJPG"),
        }
    }

    /// Bytes of a row of so many pixels; 0 when rows have no bytes of their own.
    fn row_bytes(self, width: u32) -> u32 {
        match self {
            Self::Grey => width,
            Self::Yuyv => width.saturating_mul(2),
            Self::Mjpg => 0,
        }
    }
}

impl Shape {
    /// The form that a device answers with: pixels in a row, rows, bytes from one row to the next (without meaning for JPEG).
    ///
    /// # Errors
    /// When the pictures are empty, or their rows longer than what lies between them.
    pub fn new(coding: Coding, width: u32, height: u32, stride: u32) -> Result<Self, Trouble> {
        let row = coding.row_bytes(width);
        if width == 0 || height == 0 || stride < row {
            return Err(Trouble::Stride { stride, row, width });
        }
        Ok(Self { coding, width, height, stride })
    }

    /// How the pixels are coded.
    #[must_use]
    pub fn coding(&self) -> Coding {
        self.coding
    }

    /// Pixels in a row.
    #[must_use]
    pub fn width(&self) -> u32 {
        self.width
    }

    /// Rows.
    #[must_use]
    pub fn height(&self) -> u32 {
        self.height
    }

    /// Pixels of a picture.
    #[must_use]
    pub fn pixels(&self) -> usize {
        self.width as usize * self.height as usize
    }

    /// Writes the luminance of a frame, row by row without gaps, into `luminance`, which has [`Shape::pixels`] bytes.
    ///
    /// # Errors
    /// When the frame's bytes are no picture of this shape.
    pub fn luminance(&self, frame: &[u8], luminance: &mut [u8]) -> Result<(), Damage> {
        match self.coding {
            Coding::Grey => self.rows(frame, luminance, <[u8]>::copy_from_slice),
            Coding::Yuyv => self.rows(frame, luminance, |row, pairs| {
                row.iter_mut().zip(pairs.chunks_exact(2)).for_each(|(pixel, pair)| *pixel = pair[0]);
            }),
            Coding::Mjpg => self.jpeg(frame, luminance),
        }
    }

    fn rows(&self, frame: &[u8], luminance: &mut [u8], convert: impl Fn(&mut [u8], &[u8])) -> Result<(), Damage> {
        let (row, stride) = (self.coding.row_bytes(self.width) as usize, self.stride as usize);
        let expected = stride * (self.height as usize).saturating_sub(1) + row;
        if frame.len() < expected {
            return Err(Damage::Short { found: frame.len(), expected });
        }
        for (to, from) in luminance.chunks_exact_mut(self.width as usize).zip(frame.chunks(stride)) {
            convert(to, &from[..row]);
        }
        Ok(())
    }

    fn jpeg(&self, frame: &[u8], luminance: &mut [u8]) -> Result<(), Damage> {
        let frame = with_huffman_tables(frame);
        self.decode(&frame, luminance)?;
        let end = end_of_data(&frame).ok_or(Damage::Cut { found: frame.len() })?;
        // The decoder makes up what is missing, and does not say so. A picture that has all of its data does not change when
        // more follows.
        let mut longer = luminance.to_vec();
        self.decode(&[&frame[..end], &[0x5a; MORE], &frame[end..]].concat(), &mut longer)?;
        if longer == luminance { Ok(()) } else { Err(Damage::Incomplete { found: frame.len() }) }
    }

    /// Decodes what should be a whole picture: a code that is none is an error. Bytes between segments, and segments in odd places,
    /// are no damage; some cameras send them.
    fn decode(&self, frame: &[u8], luminance: &mut [u8]) -> Result<(), Damage> {
        let strict = self.decode_as(frame, luminance, true);
        match &strict {
            Err(Damage::Jpeg(error)) if BORNE.iter().any(|borne| error.contains(borne)) => self.decode_as(frame, luminance, false),
            _ => strict,
        }
    }

    fn decode_as(&self, frame: &[u8], luminance: &mut [u8], strict: bool) -> Result<(), Damage> {
        let options = DecoderOptions::default().jpeg_set_out_colorspace(ColorSpace::Luma).set_strict_mode(strict);
        let mut decoder = JpegDecoder::new_with_options(ZCursor::new(frame), options);
        decoder.decode_headers().map_err(|error| Damage::Jpeg(error.to_string()))?;
        let expected = (self.width as usize, self.height as usize);
        match decoder.info().map(|info| (usize::from(info.width), usize::from(info.height))) {
            Some(found) if found != expected => return Err(Damage::Size { found, expected }),
            _ => {}
        }
        decoder.decode_into(luminance).map_err(|error| Damage::Jpeg(error.to_string()))
    }
}

/// Bytes of data put behind a picture's own: more than one block of any picture.
const MORE: usize = 256;

/// What the decoder calls an error in its strict mode and is none in pictures of cameras.
const BORNE: [&str; 2] = ["Extra bytes", "Unexpected marker"];

/// Where the data of a JPEG picture ends: at the marker of its end, behind its last scan. `None` when it has none.
fn end_of_data(frame: &[u8]) -> Option<usize> {
    let mut at = 2;
    loop {
        let [high, low] = *frame.get(at..at + 2)? else { return None };
        match (high, low) {
            (0xff, 0xd9) => return Some(at),
            // A stuffed zero, a restart marker, a filling byte, or data.
            (0xff, 0x00 | 0xd0..=0xd7) => at += 2,
            (0xff, 0x01..=0xcf | 0xda..=0xfe) => {
                let length = frame.get(at + 2..at + 4)?;
                at += 2 + usize::from(u16::from_be_bytes([length[0], length[1]])).max(2);
            }
            _ => at += 1,
        }
    }
}

/// A JPEG picture that has its Huffman tables or says that it means the standard ones.
///
/// Many cameras leave the tables out, as motion JPEG allows. The decoder then takes the standard tables if a segment `AVI1` says
/// that this is motion JPEG; where that is missing too, it is put in.
fn with_huffman_tables(frame: &[u8]) -> std::borrow::Cow<'_, [u8]> {
    const START: [u8; 2] = [0xff, 0xd8];
    const AVI1: [u8; 10] = [0xff, 0xe0, 0, 8, b'A', b'V', b'I', b'1', 0, 0];
    match frame.strip_prefix(&START) {
        Some(rest) if !has_segment(rest, 0xc4) => [&START[..], &AVI1, rest].concat().into(),
        _ => frame.into(),
    }
}

/// Whether a segment of this kind comes before the picture's data.
fn has_segment(mut segments: &[u8], wanted: u8) -> bool {
    const SCAN: u8 = 0xda;
    while let [0xff, kind, high, low, ..] = *segments {
        if kind == wanted || kind == SCAN {
            return kind == wanted;
        }
        let length = 2 + usize::from(u16::from_be_bytes([high, low]));
        segments = segments.get(length..).unwrap_or_default();
    }
    false
}
