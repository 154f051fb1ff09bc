//! Large arrays of numbers, copied as they lie in memory.

use std::borrow::Cow;

use bytemuck::Pod;
use postcard_schema::Schema;
use postcard_schema::schema::{DataModelType, NamedType};
use serde::de::Error;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// Numbers that are written as the bytes of their memory, which is little-endian on every machine that stillmap runs on: copied at once
/// instead of encoded one by one.
///
/// ```
/// use stillmap_state::{Packed, decode, encode};
///
/// let numbers = [0.5_f32; 1000];
/// let bytes = encode(&Packed::from(&numbers[..]), Vec::new());
/// assert_eq!(bytes.len(), 8 + 2 + 4000);
/// assert_eq!(decode::<Packed<f32>>(&bytes).unwrap().into_vec(), numbers);
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct Packed<'a, T: Clone>(Cow<'a, [T]>);

impl<'a, T: Clone> From<&'a [T]> for Packed<'a, T> {
    fn from(numbers: &'a [T]) -> Self {
        Self(Cow::Borrowed(numbers))
    }
}

impl<T: Clone> Packed<'_, T> {
    /// The numbers.
    #[must_use]
    pub fn into_vec(self) -> Vec<T> {
        self.0.into_owned()
    }
}

impl<T: Pod> Serialize for Packed<'_, T> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_bytes(bytemuck::cast_slice(&self.0))
    }
}

impl<'de, T: Pod> Deserialize<'de> for Packed<'_, T> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let bytes = <&[u8]>::deserialize(deserializer)?;
        if !bytes.len().is_multiple_of(size_of::<T>().max(1)) {
            return Err(D::Error::invalid_length(bytes.len(), &"whole numbers"));
        }
        Ok(Self(Cow::Owned(bytemuck::allocation::pod_collect_to_vec(bytes))))
    }
}

impl<T: Schema + Clone + 'static> Schema for Packed<'_, T> {
    const SCHEMA: &'static NamedType = &NamedType { name: "Packed", ty: &DataModelType::Tuple(&[T::SCHEMA, <[u8]>::SCHEMA]) };
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{decode, encode, version};

    #[test]
    fn a_number_cut_in_two_is_refused() {
        let bytes = encode(&Packed::from(&[1_u8, 2, 3][..]), Vec::new());
        let mut as_f32 = version::<Packed<'_, f32>>().to_le_bytes().to_vec();
        as_f32.extend(&bytes[8..]);
        assert!(decode::<Packed<'_, f32>>(&as_f32).unwrap_err().to_string().starts_with("the state cannot be decoded"));
    }

    #[test]
    fn packed_numbers_are_another_schema_than_a_list() {
        assert_ne!(version::<Packed<'_, f32>>(), version::<Vec<f32>>());
    }
}
