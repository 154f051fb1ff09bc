//! A line that a process has logged as a `foxglove.Log`, with its number behind it.

use foxglove::Decode;
use foxglove::messages::Log;
use prost::Message;

use messages::{LogLine, Text};

use crate::decode_error::DecodeError;
use crate::tile::timestamp;

/// The field that follows those of the line, under a number that no line uses.
#[derive(Clone, PartialEq, Message)]
struct Rest {
    #[prost(uint64, tag = "1001")]
    seq: u64,
}

/// The levels of both have the same numbers.
pub(crate) fn encode(line: &LogLine, seq: u64, stamp_ns: u64) -> Vec<u8> {
    let log = Log {
        timestamp: Some(timestamp(stamp_ns)),
        level: i32::try_from(line.level).unwrap_or_default(),
        message: line.message.as_str().to_owned(),
        name: line.process.as_str().to_owned(),
        file: String::new(),
        line: 0,
    };
    let mut bytes = Message::encode_to_vec(&log);
    bytes.extend(Message::encode_to_vec(&Rest { seq }));
    bytes
}

/// The sequence number and the line.
pub(crate) fn decode(data: &[u8]) -> Result<(u64, LogLine), DecodeError> {
    let log = <Log as Decode>::decode(data)?;
    let rest = <Rest as Message>::decode(data)?;
    let line = LogLine {
        process: Text::new(&log.name),
        message: Text::new(&log.message),
        level: u32::try_from(log.level).unwrap_or_default(),
        ..LogLine::default()
    };
    Ok((rest.seq, line))
}
