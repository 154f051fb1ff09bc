//! The content of a chunk.

use std::io::{self, Read};

use crate::damage::Damage;
use crate::fields::Fields;

/// The largest record that is read; the largest that is written is a picture of the map.
pub(crate) const MAX_RECORD: u64 = 64 << 20;

/// The records of a chunk, decompressed and checked.
pub(crate) fn unpack(offset: u64, body: &[u8]) -> Result<Vec<u8>, Damage> {
    let wrong = |found: String, expected: &str| Damage { offset, found, expected: expected.to_owned(), skipped: 0 };
    let mut fields = Fields(body);
    let Some((size, crc, compression, packed)) = packed_content(&mut fields) else {
        return Err(wrong("a chunk that does not fit its length".to_owned(), "a complete chunk"));
    };
    if size > MAX_RECORD {
        return Err(wrong(format!("a chunk of {size} bytes"), "at most 67108864"));
    }
    let content = match compression {
        "" => packed.to_vec(),
        "lz4" => {
            let mut content = Vec::with_capacity(size as usize);
            let unpacked = lz4::Decoder::new(packed).and_then(|decoder| decoder.take(size + 1).read_to_end(&mut content));
            unpacked.map_err(|error| wrong(format!("a chunk that cannot be unpacked ({error})"), "LZ4"))?;
            content
        }
        "zstd" => {
            let mut content = Vec::with_capacity(size as usize);
            let unpacked = ruzstd::decoding::StreamingDecoder::new(packed)
                .map_err(io::Error::other)
                .and_then(|decoder| decoder.take(size + 1).read_to_end(&mut content));
            unpacked.map_err(|error| wrong(format!("a chunk that cannot be unpacked ({error})"), "zstd"))?;
            content
        }
        other => return Err(wrong(format!("compression {other:?}"), "lz4, zstd or none")),
    };
    let calculated = crc32fast::hash(&content);
    // 0 stands for no checksum.
    if content.len() as u64 != size || (crc != 0 && crc != calculated) {
        let found = format!("a chunk of {} bytes with checksum {calculated:08x}", content.len());
        return Err(wrong(found, &format!("{size} bytes with checksum {crc:08x}")));
    }
    Ok(content)
}

/// Size and checksum of a chunk's content, how it is packed, and what it is packed into.
fn packed_content<'a>(fields: &mut Fields<'a>) -> Option<(u64, u32, &'a str, &'a [u8])> {
    fields.u64()?;
    fields.u64()?;
    let (size, crc) = (fields.u64()?, fields.u32()?);
    let compression = fields.text()?;
    let length = fields.u64()?;
    let packed = fields.bytes(length)?;
    fields.0.is_empty().then_some((size, crc, compression, packed))
}
