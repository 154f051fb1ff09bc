#![cfg_attr(test, allow(clippy::unwrap_used, reason = "tests fail by panicking"))]

//! State as bytes of a checkpoint.
//!
//! A state is a type with the derives of serde and of [`Schema`]. [`encode`] writes it with postcard behind a version, which is a
//! hash of its schema: names, types and order of its fields. [`decode`] refuses bytes of another version, so that a build never
//! takes the state of another build for its own, and no number has to be raised by hand. What the types cannot say, for example
//! that numbers are in order, the owner of the state checks.
//!
//! State that grows with the map has a head and parts: [`InParts`] stands for the parts in the schema of the head. [`Packed`]
//! holds large arrays of numbers, which are copied instead of encoded one by one.

mod packed;
mod queue;

use std::marker::PhantomData;

use postcard_schema::key::Key;
use postcard_schema::schema::NamedType;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

pub use packed::Packed;
pub use postcard_schema::Schema;
pub use queue::Queue;

/// Bytes before the encoded state.
const VERSION_BYTES: usize = 8;

/// Bytes that are no state of a type.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum DecodeError {
    /// They were written by a build whose type has another schema.
    #[error("a state of version {found:016x}, expected {expected:016x}")]
    Version {
        /// The version of the bytes.
        found: u64,
        /// The version of the type.
        expected: u64,
    },
    /// They are fewer than a version has.
    #[error("a state of {found} bytes, expected at least {VERSION_BYTES}")]
    Short {
        /// Number of bytes.
        found: usize,
    },
    /// They end too early, or a value is not one of its type.
    #[error("the state cannot be decoded: {0}")]
    Damaged(#[from] postcard::Error),
    /// Bytes are left over.
    #[error("{found} bytes follow the state, expected none")]
    Long {
        /// Number of bytes.
        found: usize,
    },
}

/// The version of a type: a hash of its schema.
///
/// ```
/// use stillmap_state::version;
///
/// assert_eq!(version::<(u64, Vec<f32>)>(), version::<(u64, Vec<f32>)>());
/// assert_ne!(version::<(u64, Vec<f32>)>(), version::<(u64, Vec<f64>)>());
/// ```
#[must_use]
pub fn version<T: Schema + ?Sized>() -> u64 {
    u64::from_le_bytes(Key::for_path::<T>("").to_bytes())
}

/// Appends a state to `bytes`, which may be the memory of an earlier one.
///
/// ```
/// use stillmap_state::{decode, encode};
///
/// let bytes = encode(&(7_u64, vec![0.5_f32]), Vec::new());
/// assert_eq!(decode::<(u64, Vec<f32>)>(&bytes), Ok((7, vec![0.5])));
/// assert!(decode::<(u64, Vec<f64>)>(&bytes).unwrap_err().to_string().starts_with("a state of version "));
/// ```
#[must_use]
pub fn encode<T: Serialize + Schema + ?Sized>(state: &T, mut bytes: Vec<u8>) -> Vec<u8> {
    bytes.extend(version::<T>().to_le_bytes());
    // Encoding into memory fails only for a sequence of unknown length, which no derived implementation has.
    postcard::to_extend(state, bytes).unwrap_or_default()
}

/// The state of bytes that [`encode`] appended.
///
/// # Errors
/// Bytes of another version, cut or damaged bytes, and bytes that are left over.
pub fn decode<T: DeserializeOwned + Schema>(bytes: &[u8]) -> Result<T, DecodeError> {
    let (state, rest) = take(bytes)?;
    if rest.is_empty() { Ok(state) } else { Err(DecodeError::Long { found: rest.len() }) }
}

/// As [`decode`], with the bytes that follow the state: a process saves its cursors before the state of its algorithm.
///
/// # Errors
/// Bytes of another version, cut or damaged bytes.
pub fn take<T: DeserializeOwned + Schema>(bytes: &[u8]) -> Result<(T, &[u8]), DecodeError> {
    let Some((found, rest)) = bytes.split_first_chunk::<VERSION_BYTES>() else { return Err(DecodeError::Short { found: bytes.len() }) };
    let (found, expected) = (u64::from_le_bytes(*found), version::<T>());
    if found != expected {
        return Err(DecodeError::Version { found, expected });
    }
    Ok(postcard::take_from_bytes(rest)?)
}

/// Appends a part of a state, whose version is that of the head.
#[must_use]
pub fn encode_part<T: Serialize + ?Sized>(part: &T, bytes: Vec<u8>) -> Vec<u8> {
    postcard::to_extend(part, bytes).unwrap_or_default()
}

/// The part of bytes that [`encode_part`] appended.
///
/// # Errors
/// Cut or damaged bytes, and bytes that are left over.
pub fn decode_part<T: DeserializeOwned>(bytes: &[u8]) -> Result<T, DecodeError> {
    let (part, rest) = postcard::take_from_bytes(bytes)?;
    if rest.is_empty() { Ok(part) } else { Err(DecodeError::Long { found: rest.len() }) }
}

/// Stands in the head of a state for its parts of type `T`: no bytes, but part of the version.
///
/// ```
/// use stillmap_state::{InParts, version};
///
/// assert_ne!(version::<(u64, InParts<[f32; 4]>)>(), version::<(u64, InParts<[u16; 4]>)>());
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct InParts<T>(PhantomData<T>);

impl<T> Default for InParts<T> {
    fn default() -> Self {
        Self(PhantomData)
    }
}

impl<T: Schema> Schema for InParts<T> {
    const SCHEMA: &'static NamedType = T::SCHEMA;
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    type Example = (u64, Option<(f64, bool)>, Vec<i32>);

    proptest! {
        #[test]
        fn a_state_is_decoded_as_it_was_encoded(number in any::<u64>(), list in proptest::collection::vec(any::<i32>(), 0..9)) {
            let state: Example = (number, (number % 2 == 0).then_some((0.5, true)), list);
            let bytes = encode(&state, Vec::new());
            prop_assert_eq!(decode::<Example>(&bytes), Ok(state));
            for end in 0..bytes.len() {
                prop_assert!(decode::<Example>(&bytes[..end]).is_err());
            }
        }

        #[test]
        fn any_bytes_are_decoded_or_refused(bytes in proptest::collection::vec(any::<u8>(), 0..100)) {
            let _ = decode::<Example>(&bytes);
            let _ = decode_part::<Example>(&bytes);
        }
    }

    #[test]
    fn fields_of_other_names_make_another_version() {
        #[derive(Schema)]
        #[expect(dead_code, reason = "only its schema matters")]
        struct Before {
            range_m: f64,
        }
        #[derive(Schema)]
        #[expect(dead_code, reason = "only its schema matters")]
        struct After {
            width_m: f64,
        }
        assert_ne!(version::<Before>(), version::<After>());
    }

    #[test]
    fn bytes_left_over_are_refused() {
        let mut bytes = encode(&7_u64, Vec::new());
        bytes.push(0);
        assert_eq!(decode::<u64>(&bytes), Err(DecodeError::Long { found: 1 }));
    }
}
