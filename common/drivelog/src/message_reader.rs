//! From the records of an MCAP file to its messages.

use std::collections::BTreeMap;
use std::io::{self, Read, Seek, SeekFrom};
use std::ops::Range;

use crate::chunk::unpack;
use crate::damage::{Damage, Fault};
use crate::deframer::{opcode, split_record};
use crate::ending::Ending;
use crate::fields::Fields;
use crate::preamble::CONTINUED;
use crate::records::{Channel, Record, RecordReader, Schema, channel, damage, named_texts, schema};
use crate::summary::{Summary, Topics};

/// A message as the file has it.
#[derive(Debug, Clone, Copy)]
pub struct RawMessage<'a> {
    /// Its channel.
    pub channel: &'a Channel,
    /// Low 32 bits of its sequence number.
    pub sequence: u32,
    /// Its stamp.
    pub stamp_ns: u64,
    /// Its place on the log's time line: the stamp if that is sensor time, else the sensor time when it was recorded.
    pub log_ns: u64,
    /// The message.
    pub data: &'a [u8],
    /// Where the chunk that holds it starts in the file.
    pub offset: u64,
}

/// Reads the messages of an MCAP file in the order in which they were written.
pub(crate) struct MessageReader<R> {
    records: RecordReader<R>,
    /// Another part follows.
    continues: bool,
    /// Messages have been found in chunks.
    has_chunks: bool,
    schemas: BTreeMap<u16, Schema>,
    channels: BTreeMap<u16, Channel>,
    /// The records of the current chunk.
    chunk: Vec<u8>,
    cursor: usize,
    chunk_offset: u64,
    /// The current message.
    message: Option<Position>,
}

/// A message in the current chunk.
pub(crate) struct Position {
    pub(crate) channel: u16,
    pub(crate) sequence: u32,
    pub(crate) log_ns: u64,
    pub(crate) stamp_ns: u64,
    pub(crate) data: Range<usize>,
}

impl<R: Read> MessageReader<R> {
    pub(crate) fn new(records: RecordReader<R>) -> Self {
        Self::with_topics(records, Topics::default())
    }

    /// Reads messages whose topics need not be named before them.
    pub(crate) fn with_topics(records: RecordReader<R>, (schemas, channels): Topics) -> Self {
        Self {
            records,
            continues: false,
            has_chunks: false,
            schemas,
            channels,
            chunk: Vec::new(),
            cursor: 0,
            chunk_offset: 0,
            message: None,
        }
    }

    /// Whether the file says that another part follows. It says so at its end.
    pub(crate) fn continues(&self) -> bool {
        self.continues
    }

    /// Bytes of the file that have been read.
    pub(crate) fn offset(&self) -> u64 {
        self.records.offset()
    }

    /// How the file ends; none before its end was reached.
    pub(crate) fn ending(&self) -> Option<&Ending> {
        self.records.ending()
    }

    /// Makes the next message the current one; false at the end of what can be read.
    ///
    /// # Errors
    /// [`Fault::Damaged`] when a chunk cannot be read; the next call continues behind it, if that can be found.
    pub(crate) fn advance(&mut self) -> Result<bool, Fault> {
        self.message = None;
        while self.message.is_none() {
            if self.next_in_chunk()? {
                continue;
            }
            let Some(record) = self.records.next()? else { return Ok(false) };
            self.open(record)?;
        }
        Ok(true)
    }

    /// Passes over chunks whose messages are all before this log time, as far as the file has an index; true if it has passed over any.
    ///
    /// # Errors
    /// When the file cannot be read.
    pub(crate) fn skip_to(&mut self, from_ns: u64) -> io::Result<bool>
    where
        R: Seek,
    {
        let offset = self.records.offset();
        let source = self.records.source();
        let place = source.stream_position()?;
        let summary = Summary::read(source)?;
        let Some(start) = summary.start(from_ns).filter(|start| *start > offset) else {
            source.seek(SeekFrom::Start(place))?;
            return Ok(false);
        };
        self.records.continue_at(start)?;
        let (schemas, channels) = summary.topics;
        self.schemas.extend(schemas);
        self.channels.extend(channels);
        self.has_chunks = true;
        (self.message, self.cursor) = (None, self.chunk.len());
        Ok(true)
    }

    /// The current message.
    pub(crate) fn message(&self) -> Option<RawMessage<'_>> {
        let Position { channel, sequence, log_ns, stamp_ns, data } = self.message.as_ref()?;
        let channel = self.channels.get(channel)?;
        let data = self.chunk.get(data.clone())?;
        Some(RawMessage { channel, sequence: *sequence, stamp_ns: *stamp_ns, log_ns: *log_ns, data, offset: self.chunk_offset })
    }

    /// Makes the records of a chunk the current ones, or a record that stands by itself.
    fn open(&mut self, record: Record) -> Result<(), Damage> {
        self.chunk_offset = record.offset;
        self.cursor = 0;
        self.chunk.clear();
        match record.opcode {
            opcode::CHUNK => {
                self.has_chunks = true;
                self.chunk = unpack(record.offset, &record.body).inspect_err(|_| self.records.distrust())?;
            }
            // Other tools write logs without chunks. Beside chunks a message is another record with a changed bit, and has no checksum.
            opcode::MESSAGE if self.has_chunks => return Err(damage(&record, "a message by itself", "messages in chunks")),
            opcode::SCHEMA | opcode::CHANNEL | opcode::MESSAGE if !self.has_chunks => {
                self.chunk.push(record.opcode);
                self.chunk.extend((record.body.len() as u64).to_le_bytes());
                self.chunk.extend(record.body);
            }
            opcode::METADATA => self.continues |= named_texts(&record.body).is_some_and(|(name, _)| name == CONTINUED),
            // The index of what was read.
            _ => {}
        }
        Ok(())
    }

    /// Makes the next message of the current chunk the current one; false when there is none.
    fn next_in_chunk(&mut self) -> Result<bool, Damage> {
        while self.cursor < self.chunk.len() {
            let Some((opcode, body, rest)) = split_record(&self.chunk[self.cursor..]) else {
                return Err(self.give_up("half a record"));
            };
            let end = self.chunk.len() - rest.len();
            let mut fields = Fields(body);
            let understood = match opcode {
                opcode::SCHEMA => schema(&mut fields).map(|(id, schema)| {
                    self.schemas.insert(id, schema);
                }),
                opcode::CHANNEL => channel(&mut fields, &self.schemas).map(|(id, channel)| {
                    self.channels.insert(id, channel);
                }),
                opcode::MESSAGE => position(&mut fields, end).map(|message| self.message = Some(message)),
                _ => Some(()),
            };
            if understood.is_none() {
                return Err(self.give_up(&format!("a record of type {opcode:#04x} that does not fit its length")));
            }
            self.cursor = end;
            if let Some(message) = &self.message {
                if self.channels.contains_key(&message.channel) {
                    return Ok(true);
                }
                let found = format!("a message of channel {}", message.channel);
                return Err(self.give_up(&found));
            }
        }
        Ok(false)
    }

    /// Leaves the rest of the current chunk.
    fn give_up(&mut self, found: &str) -> Damage {
        self.cursor = self.chunk.len();
        self.message = None;
        let expected = "complete records of schemas and channels, and messages of these channels".to_owned();
        Damage { offset: self.chunk_offset, found: format!("in the chunk there, {found}"), expected, skipped: 0 }
    }
}

/// A message whose bytes reach up to `end` of the chunk.
pub(crate) fn position(fields: &mut Fields<'_>, end: usize) -> Option<Position> {
    let (channel, sequence) = (fields.u16()?, fields.u32()?);
    let (log_ns, stamp_ns) = (fields.u64()?, fields.u64()?);
    Some(Position { channel, sequence, log_ns, stamp_ns, data: end - fields.0.len()..end })
}
