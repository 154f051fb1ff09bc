//! Messages as a log holds them.

use schemars::JsonSchema;
use schemars::generate::SchemaSettings;
use serde::{Deserialize, Serialize};

use messages::{Invalid, LogLine, MapTile, Payload};

use crate::mirror::{Mirrored, Unfit};
use crate::{line, tile};

/// What a channel of a log says of its messages.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Format {
    /// Name of the schema, for example `stillmap.SonarScan` or `foxglove.Grid`.
    pub schema_name: String,
    /// `jsonschema` or `protobuf`.
    pub schema_encoding: String,
    /// The schema itself.
    pub schema: Vec<u8>,
    /// `json` or `protobuf`.
    pub message_encoding: String,
}

/// Bytes in a log that are not the message they should be.
#[derive(Debug, thiserror::Error)]
pub enum DecodeError {
    /// Not the JSON of this message.
    #[error("the message cannot be read: {0}")]
    Json(#[from] serde_json::Error),
    /// JSON of this message with too much in it.
    #[error(transparent)]
    Unfit(#[from] Unfit),
    /// Not a protobuf message.
    #[error("the message cannot be read: {0}")]
    Protobuf(#[from] prost::DecodeError),
    /// A grid that is no tile of a map.
    #[error("the grid is no tile: {what} is {found}, expected {expected}")]
    NoTile {
        /// What is wrong with it.
        what: &'static str,
        /// Its value.
        found: f64,
        /// What it should be.
        expected: f64,
    },
    /// A picture whose pixels are stored in a way that no picture of ours is.
    #[error("the picture's encoding is {0:?}, expected mono8, yuyv or rgb8")]
    Encoding(String),
    /// Numbers that cannot be meant.
    #[error(transparent)]
    Invalid(#[from] Invalid),
}

/// A payload that logs hold: numbers come back bit for bit.
///
/// The sequence number travels inside; the stamp is the log time of the MCAP message; the run is the log's.
pub trait Logged: Payload {
    /// What the channel says.
    fn format() -> Format;

    /// The bytes of a message.
    fn encode(&self, seq: u64, stamp_ns: u64) -> Vec<u8>;

    /// The sequence number and the payload, as they were; the payload is not validated.
    ///
    /// # Errors
    /// When the bytes are not those of such a message.
    fn decode(data: &[u8]) -> Result<(u64, Self), DecodeError>;
}

/// The JSON of a message: its sequence number among the fields of its payload.
#[derive(Serialize, JsonSchema)]
struct Numbered<J> {
    seq: u64,
    #[serde(flatten)]
    payload: J,
}

/// The sequence number alone.
#[derive(Deserialize)]
struct Seq {
    seq: u64,
}

impl<T: Payload + Mirrored> Logged for T {
    fn format() -> Format {
        let name = core::any::type_name::<T>().rsplit("::").next().unwrap_or_default();
        json_format::<Numbered<T::Json>>(name)
    }

    fn encode(&self, seq: u64, _stamp_ns: u64) -> Vec<u8> {
        // Fails for maps whose keys are no text; no payload has a map.
        serde_json::to_vec(&Numbered { seq, payload: self.to_json() }).unwrap_or_default()
    }

    fn decode(data: &[u8]) -> Result<(u64, Self), DecodeError> {
        // Read twice: flattened, numbers would go through a type that knows no f32.
        let Seq { seq } = serde_json::from_slice(data)?;
        Ok((seq, T::from_json(serde_json::from_slice(data)?)?))
    }
}

impl Logged for MapTile {
    fn format() -> Format {
        foxglove_format::<foxglove::messages::Grid>()
    }

    fn encode(&self, seq: u64, stamp_ns: u64) -> Vec<u8> {
        tile::encode(self, seq, stamp_ns)
    }

    fn decode(data: &[u8]) -> Result<(u64, Self), DecodeError> {
        tile::decode(data)
    }
}

impl Logged for LogLine {
    fn format() -> Format {
        foxglove_format::<foxglove::messages::Log>()
    }

    fn encode(&self, seq: u64, stamp_ns: u64) -> Vec<u8> {
        line::encode(self, seq, stamp_ns)
    }

    fn decode(data: &[u8]) -> Result<(u64, Self), DecodeError> {
        line::decode(data)
    }
}

/// JSON with a schema that names no other: Foxglove does not follow references.
pub(crate) fn json_format<J: JsonSchema>(name: &str) -> Format {
    let schema = SchemaSettings::draft07().with(|settings| settings.inline_subschemas = true).into_generator().into_root_schema_for::<J>();
    Format {
        schema_name: format!("stillmap.{name}"),
        schema_encoding: "jsonschema".to_owned(),
        schema: schema.as_value().to_string().into_bytes(),
        message_encoding: "json".to_owned(),
    }
}

/// What a channel of one of Foxglove's own messages says.
#[must_use]
pub fn foxglove_format<M: foxglove::Encode>() -> Format {
    let schema = M::get_schema();
    Format {
        schema_name: schema.as_ref().map(|schema| schema.name.clone()).unwrap_or_default(),
        schema_encoding: schema.as_ref().map(|schema| schema.encoding.clone()).unwrap_or_default(),
        schema: schema.map(|schema| schema.data.into_owned()).unwrap_or_default(),
        message_encoding: M::get_message_encoding(),
    }
}
