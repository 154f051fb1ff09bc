//! Messages of a bag as they are stored.

use std::borrow::Cow;
use std::io::Read;

/// What a message starts with that `ros2 bag record --compression-mode message` has packed.
const ZSTD_MAGIC: [u8; 4] = [0x28, 0xb5, 0x2f, 0xfd];
/// The largest message that is unpacked or read from SQLite, bytes: as for a chunk of an MCAP file.
pub(crate) const MAX_MESSAGE: u64 = 64 << 20;

/// A topic of a bag.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Topic {
    pub(crate) name: String,
    /// For example `sensor_msgs/msg/Range`.
    pub(crate) type_name: String,
    /// For example `cdr`.
    pub(crate) encoding: String,
}

/// A message of a bag.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Message<'a> {
    pub(crate) topic: &'a Topic,
    pub(crate) received_ns: u64,
    /// Its bytes, which may be packed.
    pub(crate) stored: &'a [u8],
}

impl<'a> Message<'a> {
    /// The bytes of the message.
    pub(crate) fn data(&self) -> Result<Cow<'a, [u8]>, String> {
        unpack(self.stored, MAX_MESSAGE)
    }
}

fn unpack(stored: &[u8], limit: u64) -> Result<Cow<'_, [u8]>, String> {
    if !stored.starts_with(&ZSTD_MAGIC) {
        return Ok(Cow::Borrowed(stored));
    }
    let failed = |error: &dyn std::fmt::Display| format!("messages that cannot be unpacked: {error}");
    let decoder = ruzstd::decoding::StreamingDecoder::new(stored).map_err(|error| failed(&error))?;
    let mut unpacked = Vec::new();
    decoder.take(limit + 1).read_to_end(&mut unpacked).map_err(|error| failed(&error))?;
    if unpacked.len() as u64 > limit {
        return Err(format!("messages that unpack to more than {limit} bytes"));
    }
    Ok(Cow::Owned(unpacked))
}

#[cfg(test)]
mod tests {
    use super::*;
    use ruzstd::encoding::{CompressionLevel, compress_to_vec};

    #[test]
    fn a_message_that_unpacks_to_too_much_is_refused() {
        let packed = compress_to_vec(&[7; 1000][..], CompressionLevel::Fastest);
        assert_eq!(unpack(&packed, 1000).unwrap(), vec![7; 1000]);
        assert_eq!(unpack(&packed, 999).unwrap_err(), "messages that unpack to more than 999 bytes");
        assert!(unpack(&packed[..6], 1000).unwrap_err().starts_with("messages that cannot be unpacked: "));
    }
}
