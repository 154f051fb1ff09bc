//! Messages in CDR: four bytes that name the byte order, and the fields.

use byteorder::{BigEndian, LittleEndian};
use cdr_encoding::{from_bytes, to_vec};
use serde::Serialize;
use serde::de::DeserializeOwned;

/// Bytes before the fields.
const HEAD: usize = 4;
/// The head of little-endian fields.
const LITTLE_ENDIAN: [u8; HEAD] = [0, 1, 0, 0];

/// A message whose first fields are `T`; the rest is ignored.
pub(crate) fn decode<T: DeserializeOwned>(data: &[u8]) -> Result<T, String> {
    Ok(decode_front(data)?.0)
}

/// A message whose first fields are `T`, and the bytes that follow as a list.
pub(crate) fn decode_with_bytes<T: DeserializeOwned>(data: &[u8]) -> Result<(T, &[u8]), String> {
    let (head, consumed, is_little) = decode_front(data)?;
    let fields = data.get(HEAD..).unwrap_or_default();
    let start = consumed.next_multiple_of(4);
    let length = fields.get(start..start + 4).and_then(|bytes| bytes.try_into().ok());
    let length = length.map(|bytes| if is_little { u32::from_le_bytes(bytes) } else { u32::from_be_bytes(bytes) } as usize);
    let bytes = length.and_then(|length| fields.get(start + 4..)?.get(..length));
    Ok((head, bytes.ok_or("the message is cut")?))
}

/// The fields, the bytes that they take, and whether these are little-endian.
fn decode_front<T: DeserializeOwned>(data: &[u8]) -> Result<(T, usize, bool), String> {
    let (head, fields) = data.split_first_chunk::<HEAD>().ok_or("the message is cut")?;
    // Plain CDR; the other representations lay fields out otherwise.
    let is_little = match head[..2] {
        [0, 0] => false,
        [0, 1] => true,
        _ => return Err(format!("its representation is {:02x}{:02x}, expected 0000 or 0001: CDR", head[0], head[1])),
    };
    let decoded = if is_little { from_bytes::<T, LittleEndian>(fields) } else { from_bytes::<T, BigEndian>(fields) };
    let (value, consumed) = decoded.map_err(|error| error.to_string())?;
    Ok((value, consumed, is_little))
}

/// The bytes of a message.
pub(crate) fn encode<T: Serialize>(message: &T) -> Vec<u8> {
    let mut bytes = LITTLE_ENDIAN.to_vec();
    // Fails for types that CDR lacks, such as maps; no message has one.
    bytes.extend(to_vec::<T, LittleEndian>(message).unwrap_or_default());
    bytes
}

/// The bytes of a message that ends with a list of bytes.
pub(crate) fn encode_with_bytes<T: Serialize>(head: &T, list: &[u8]) -> Vec<u8> {
    let mut bytes = encode(head);
    bytes.resize(bytes.len().next_multiple_of(4), 0);
    bytes.extend((list.len() as u32).to_le_bytes());
    bytes.extend(list);
    bytes
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::interfaces::{Header, ImageHead, Range, Time};

    fn head() -> ImageHead {
        let header = Header { stamp: Time { sec: 7, nanosec: 9 }, frame_id: "lens".to_owned() };
        ImageHead { header, height: 2, width: 3, encoding: "mono8".to_owned(), is_bigendian: 0, step: 3 }
    }

    #[test]
    fn bytes_behind_the_fields_come_back() {
        let data = encode_with_bytes(&head(), &[1, 2, 3, 4, 5, 6]);
        assert_eq!(decode_with_bytes::<ImageHead>(&data).unwrap(), (head(), &[1, 2, 3, 4, 5, 6][..]));
    }

    #[test]
    fn a_cut_message_is_refused_wherever_it_ends() {
        let data = encode_with_bytes(&head(), &[1, 2, 3, 4, 5, 6]);
        for length in 0..data.len() {
            assert!(decode_with_bytes::<ImageHead>(&data[..length]).is_err(), "{length}");
        }
    }

    #[test]
    fn big_endian_fields_are_read() {
        let data = [0, 0, 0, 0, 0, 0, 0, 7, 0, 0, 0, 9, 0, 0, 0, 2, b'a', 0, 0, 0, 63, 128, 0, 0, 0, 0, 0, 0, 64, 0, 0, 0, 63, 0, 0, 0];
        let range: Range = decode(&data).unwrap();
        assert_eq!((range.header.frame_id.as_str(), range.field_of_view, range.max_range, range.range), ("a", 1.0, 2.0, 0.5));
    }

    #[test]
    fn other_representations_are_named() {
        assert_eq!(decode::<Range>(&[0, 7, 0, 0]).unwrap_err(), "its representation is 0007, expected 0000 or 0001: CDR");
    }
}
