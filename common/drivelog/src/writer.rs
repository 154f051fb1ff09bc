//! From messages to the bytes of a log.

use std::cell::RefCell;
use std::collections::BTreeMap;
use std::io::{self, Write};
use std::rc::Rc;

use mcap::records::MessageHeader;
use mcap::write::NoSeek;
use mcap::{Compression, WriteOptions};
use messages::Service;
use serde::{Deserialize, Serialize};

use crate::damage::WriteError;
use crate::logged::{Format, Logged, json_format};
use crate::preamble::{Preamble, continued};
use crate::records::Channel;

/// The topic that says which streams have ended.
pub(crate) const END_TOPIC: &str = "log/end";
/// A chunk is closed when it has grown beyond this, bytes before compression.
const CHUNK: u64 = 1 << 20;

/// The end of a stream.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct End {
    /// The service whose stream ends.
    pub(crate) service: String,
    /// Its last message.
    pub(crate) seq: u64,
}

impl End {
    fn schema() -> serde_json::Value {
        serde_json::json!({
            "$schema": "http://json-schema.org/draft-07/schema#",
            "title": "End",
            "description": "The end of a stream.",
            "type": "object",
            "properties": {
                "service": { "type": "string", "description": "The service whose stream ends." },
                "seq": { "type": "integer", "minimum": 0, "description": "Its last message." },
            },
            "required": ["service", "seq"],
        })
    }
}

/// The times of a message.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Times {
    /// Sensor time when it was recorded.
    pub(crate) log_ns: u64,
    /// Its stamp.
    pub(crate) stamp_ns: u64,
}

/// Writes a log into memory; its owner writes the bytes to a file.
///
/// What [`take`](Self::take) gives after a [`flush`](Self::flush) is, with all that was taken before, a log that can be read
/// up to the last message, whatever happens next.
pub(crate) struct LogWriter {
    writer: mcap::Writer<NoSeek<Outbox>>,
    outbox: Outbox,
    channels: BTreeMap<u16, Channel>,
    chunks: u64,
}

/// The bytes that the MCAP writer has let go.
#[derive(Clone, Default)]
struct Outbox(Rc<RefCell<Vec<u8>>>);

impl Outbox {
    fn len(&self) -> usize {
        self.0.borrow().len()
    }
}

impl Write for Outbox {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.0.borrow_mut().extend_from_slice(bytes);
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

impl LogWriter {
    /// A part of a log, which starts with what its replay needs. Parts up to `removed` may be gone on purpose.
    ///
    /// # Errors
    /// When the preamble is too large for the format.
    pub(crate) fn new(preamble: &Preamble, part: u32, removed: u32) -> Result<Self, WriteError> {
        let outbox = Outbox::default();
        let mut writer = WriteOptions::new()
            .compression(Some(Compression::Lz4))
            .chunk_size(Some(CHUNK))
            // A chunk reaches the file completely or not at all.
            .disable_seeking(true)
            .library(concat!("stillmap ", env!("CARGO_PKG_VERSION")))
            .create(NoSeek::new(outbox.clone()))?;
        writer.attach(&preamble.attachment())?;
        writer.write_metadata(&preamble.metadata(part, removed))?;
        Ok(Self { writer, outbox, channels: BTreeMap::new(), chunks: 0 })
    }

    /// Adds a message of a service.
    ///
    /// # Errors
    /// When the log has more channels than the format allows.
    pub(crate) fn message<T: Logged>(&mut self, times: Times, seq: u64, payload: &T) -> Result<(), WriteError> {
        self.raw(T::SERVICE.name, T::format, times, seq as u32, &payload.encode(seq, times.stamp_ns))
    }

    /// Adds that the stream of a service ends after message `seq`.
    ///
    /// # Errors
    /// As [`message`](Self::message).
    pub(crate) fn end(&mut self, service: &Service, seq: u64, times: Times) -> Result<(), WriteError> {
        let end = End { service: service.name.to_owned(), seq };
        // Fails for maps whose keys are no text; this has none.
        let data = serde_json::to_vec(&end).unwrap_or_default();
        self.raw(END_TOPIC, || json_format("End", &End::schema()), times, seq as u32, &data)
    }

    /// Adds a message as bytes.
    pub(crate) fn raw(
        &mut self,
        topic: &str,
        format: impl FnOnce() -> Format,
        times: Times,
        sequence: u32,
        data: &[u8],
    ) -> Result<(), WriteError> {
        let known = self.channels.iter().find(|(_, channel)| channel.topic == topic);
        let channel_id = match known {
            Some((id, _)) => *id,
            None => self.add_channel(topic, format())?,
        };
        let header = MessageHeader { channel_id, sequence, log_time: times.log_ns, publish_time: times.stamp_ns };
        self.counting(|writer| writer.write_to_known_channel(&header, data))
    }

    /// Does what may close a chunk; only a chunk that is closed comes out.
    fn counting(&mut self, write: impl FnOnce(&mut mcap::Writer<NoSeek<Outbox>>) -> Result<(), mcap::McapError>) -> Result<(), WriteError> {
        let before = self.outbox.len();
        write(&mut self.writer)?;
        self.chunks += u64::from(self.outbox.len() > before);
        Ok(())
    }

    fn add_channel(&mut self, topic: &str, format: Format) -> Result<u16, WriteError> {
        let schema = match format.schema_encoding.as_str() {
            "" => 0,
            encoding => self.writer.add_schema(&format.schema_name, encoding, &format.schema)?,
        };
        let id = self.writer.add_channel(schema, topic, &format.message_encoding, &BTreeMap::new())?;
        self.channels.insert(id, Channel { topic: topic.to_owned(), format });
        Ok(id)
    }

    /// Closes the open chunk: all messages so far are among the bytes that can be taken.
    ///
    /// # Errors
    /// As [`message`](Self::message).
    pub(crate) fn flush(&mut self) -> Result<(), WriteError> {
        self.counting(mcap::Writer::flush)
    }

    /// Chunks closed so far. Each has its place in the index that ends the log; until then the index is in memory.
    #[must_use]
    pub(crate) fn chunks(&self) -> u64 {
        self.chunks
    }

    /// The channels so far.
    #[must_use]
    pub(crate) fn channels(&self) -> &BTreeMap<u16, Channel> {
        &self.channels
    }

    /// Adds that another part follows this one.
    ///
    /// # Errors
    /// As [`message`](Self::message).
    pub(crate) fn continued(&mut self) -> Result<(), WriteError> {
        Ok(self.writer.write_metadata(&continued())?)
    }

    /// The bytes that have become ready since they were last taken.
    #[must_use]
    pub(crate) fn take(&mut self) -> Vec<u8> {
        self.outbox.0.take()
    }

    /// Ends the log with its index; what it returns is the rest of the bytes.
    ///
    /// # Errors
    /// As [`message`](Self::message).
    pub(crate) fn finish(mut self) -> Result<Vec<u8>, WriteError> {
        self.writer.finish()?;
        Ok(self.take())
    }
}
