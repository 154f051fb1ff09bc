//! Payloads in a state: their bytes, as they are on the bus, and under the same rules. For `#[serde(with = "messages::payload_bytes")]`.

use serde::de::Error;
use serde::{Deserialize, Deserializer, Serializer};

use crate::Payload;

/// Writes the bytes of a payload.
///
/// # Errors
/// As the serializer.
pub fn serialize<T: Payload, S: Serializer>(payload: &T, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.serialize_bytes(bytemuck::bytes_of(payload))
}

/// Reads a payload and validates it.
///
/// # Errors
/// Another number of bytes, or a payload that is not valid.
pub fn deserialize<'de, T: Payload, D: Deserializer<'de>>(deserializer: D) -> Result<T, D::Error> {
    let bytes = <&[u8]>::deserialize(deserializer)?;
    let payload: T =
        bytemuck::try_pod_read_unaligned(bytes).map_err(|_| D::Error::invalid_length(bytes.len(), &"the bytes of a payload"))?;
    payload.validate().map_err(D::Error::custom)?;
    Ok(payload)
}
