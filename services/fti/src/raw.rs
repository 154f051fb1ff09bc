//! Payloads in the state: their bytes, as they are on the bus, and under the same rules.

use messages::Payload;
use serde::de::Error;
use serde::{Deserialize, Deserializer, Serializer};

pub(crate) fn serialize<T: Payload, S: Serializer>(payload: &T, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.serialize_bytes(bytemuck::bytes_of(payload))
}

pub(crate) fn deserialize<'de, T: Payload, D: Deserializer<'de>>(deserializer: D) -> Result<T, D::Error> {
    let bytes = <&[u8]>::deserialize(deserializer)?;
    let payload: T =
        bytemuck::try_pod_read_unaligned(bytes).map_err(|_| D::Error::invalid_length(bytes.len(), &"the bytes of a payload"))?;
    payload.validate().map_err(D::Error::custom)?;
    Ok(payload)
}
