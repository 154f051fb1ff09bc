//! Messages as a log holds them.

use messages::{LogLine, MapTile, Payload, Pictures};

use crate::decode_error::DecodeError;
use crate::{json, line, tile};

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

/// A message as JSON in one line, also where a log holds it otherwise: its number among the fields of its payload.
#[must_use]
pub fn to_json<T: Payload>(seq: u64, payload: &T) -> String {
    String::from_utf8(json::encode(seq, payload)).unwrap_or_default()
}

/// Work to be done for every service of the bus, in its form in a log: see [`visit_logged`].
pub trait LogVisitor {
    /// What ends the visit.
    type Error;

    /// A service that carries messages.
    ///
    /// # Errors
    /// Whatever ends the visit.
    fn message<T: Logged>(&mut self) -> Result<(), Self::Error>;

    /// A service that carries pictures.
    ///
    /// # Errors
    /// Whatever ends the visit.
    fn pictures<P: Pictures>(&mut self) -> Result<(), Self::Error>;
}

/// Makes every payload of the registry one that logs hold: as JSON, unless Foxglove has a message of its own for it.
macro_rules! logged {
    ($($kind:ident $ty:ident)*) => {
        $(logged!(@implement $kind $ty);)*

        /// Calls the visitor for every service of the bus.
        ///
        /// # Errors
        /// The first that the visitor returns.
        pub fn visit_logged<V: LogVisitor>(visitor: &mut V) -> Result<(), V::Error> {
            $(logged!(@visit visitor $kind $ty)?;)*
            Ok(())
        }
    };
    (@implement message MapTile) => { logged!(@foxglove MapTile, foxglove::messages::Grid, tile); };
    (@implement message LogLine) => { logged!(@foxglove LogLine, foxglove::messages::Log, line); };
    (@implement message $ty:ident) => {
        impl Logged for messages::$ty {
            fn format() -> Format {
                json_format(stringify!($ty), &json::schema::<Self>(stringify!($ty), Self::SERVICE.doc))
            }

            fn encode(&self, seq: u64, _stamp_ns: u64) -> Vec<u8> {
                json::encode(seq, self)
            }

            fn decode(data: &[u8]) -> Result<(u64, Self), DecodeError> {
                Ok(json::decode(data)?)
            }
        }
    };
    (@implement pictures $ty:ident) => {};
    (@foxglove $ty:ident, $message:ty, $codec:ident) => {
        impl Logged for $ty {
            fn format() -> Format {
                foxglove_format::<$message>()
            }

            fn encode(&self, seq: u64, stamp_ns: u64) -> Vec<u8> {
                $codec::encode(self, seq, stamp_ns)
            }

            fn decode(data: &[u8]) -> Result<(u64, Self), DecodeError> {
                $codec::decode(data)
            }
        }
    };
    (@visit $visitor:ident message $ty:ident) => { $visitor.message::<messages::$ty>() };
    (@visit $visitor:ident pictures $ty:ident) => { $visitor.pictures::<messages::$ty>() };
}
messages::for_each_service!(logged);

/// What a channel of JSON messages with this schema says.
pub(crate) fn json_format(name: &str, schema: &serde_json::Value) -> Format {
    Format {
        schema_name: format!("stillmap.{name}"),
        schema_encoding: "jsonschema".to_owned(),
        schema: schema.to_string().into_bytes(),
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
