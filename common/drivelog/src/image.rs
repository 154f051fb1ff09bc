//! A picture as a `foxglove.RawImage`, with its number behind it.

use foxglove::Decode;
use foxglove::messages::RawImage;
use prost::Message;

use messages::{FrameLayout, PixelFormat};

use crate::decode_error::DecodeError;
use crate::logged::{Format, foxglove_format};
use crate::tile::timestamp;

/// A picture of a log.
#[derive(Debug, Clone, PartialEq)]
pub struct Image {
    /// Its shape.
    pub layout: FrameLayout,
    /// Its bytes.
    pub bytes: Vec<u8>,
}

/// The field that follows those of the picture, under a number that no picture uses.
#[derive(Clone, PartialEq, Message)]
struct Rest {
    #[prost(uint64, tag = "1001")]
    seq: u64,
}

/// Foxglove's words for the formats.
const ENCODINGS: [(PixelFormat, &str); 3] = [(PixelFormat::Grey, "mono8"), (PixelFormat::Yuyv, "yuyv"), (PixelFormat::Rgb, "rgb8")];

impl Image {
    /// What a channel of pictures says: they are `foxglove.RawImage`s.
    #[must_use]
    pub fn format() -> Format {
        foxglove_format::<RawImage>()
    }

    /// The bytes of a message with a picture; its frame of reference is the camera.
    #[must_use]
    pub fn encode(layout: &FrameLayout, bytes: &[u8], seq: u64, stamp_ns: u64) -> Vec<u8> {
        let encoding = ENCODINGS.iter().find(|(format, _)| *format as u32 == layout.format).map_or("", |(_, word)| word);
        let image = RawImage {
            timestamp: Some(timestamp(stamp_ns)),
            frame_id: "camera".to_owned(),
            width: layout.width,
            height: layout.height,
            encoding: encoding.to_owned(),
            step: layout.stride,
            data: bytes.to_vec().into(),
        };
        let mut out = Message::encode_to_vec(&image);
        out.extend(Message::encode_to_vec(&Rest { seq }));
        out
    }

    /// The sequence number and the picture, whose bytes fit its shape.
    ///
    /// # Errors
    /// When the bytes are not those of such a message.
    pub fn decode(data: &[u8]) -> Result<(u64, Self), DecodeError> {
        let image = <RawImage as Decode>::decode(data)?;
        let rest = <Rest as Message>::decode(data)?;
        let Some((format, _)) = ENCODINGS.iter().find(|(_, word)| *word == image.encoding) else {
            return Err(DecodeError::Encoding(image.encoding));
        };
        let layout = FrameLayout { width: image.width, height: image.height, stride: image.step, format: *format as u32 };
        layout.validate(image.data.len())?;
        if rest.seq == 0 {
            return Err(DecodeError::Unnumbered(" in the field 1001 of the picture"));
        }
        Ok((rest.seq, Image { layout, bytes: image.data.into() }))
    }
}
