//! One file of a log, read from its start.

use std::collections::BTreeMap;
use std::io::Read;
use std::ops::Range;

use crate::chunk::unpack;
use crate::damage::{Damage, Fault};
use crate::deframer::{opcode, split_record};
use crate::ending::Ending;
use crate::fields::Fields;
use crate::preamble::{DESCRIPTION, Preamble};
use crate::records::{Channel, Record, RecordReader, Schema, channel, damage, named_texts, schema, settings_of};

/// A message as it stands in the file.
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

/// Reads the messages of one file in the order in which they were written.
pub(crate) struct PartReader<R> {
    records: RecordReader<R>,
    preamble: Preamble,
    schemas: BTreeMap<u16, Schema>,
    channels: BTreeMap<u16, Channel>,
    /// The records of the current chunk.
    chunk: Vec<u8>,
    cursor: usize,
    chunk_offset: u64,
    /// The message that was last gone on to.
    place: Option<Place>,
}

/// Where in the current chunk a message stands.
struct Place {
    channel: u16,
    sequence: u32,
    log_ns: u64,
    stamp_ns: u64,
    data: Range<usize>,
}

impl<R: Read> PartReader<R> {
    /// Reads what a log starts with.
    pub(crate) fn new(source: R) -> Result<Self, Fault> {
        let mut records = RecordReader::new(source);
        let preamble = read_preamble(&mut records)?;
        Ok(Self::after(records, preamble))
    }

    /// Reads a file whose preamble is known: another program has moved it behind the messages.
    pub(crate) fn with_preamble(source: R, preamble: Preamble) -> Self {
        Self::after(RecordReader::new(source), preamble)
    }

    fn after(records: RecordReader<R>, preamble: Preamble) -> Self {
        let (schemas, channels) = (BTreeMap::new(), BTreeMap::new());
        Self { records, preamble, schemas, channels, chunk: Vec::new(), cursor: 0, chunk_offset: 0, place: None }
    }

    pub(crate) fn preamble(&self) -> &Preamble {
        &self.preamble
    }

    /// Bytes of the file that have been read.
    pub(crate) fn offset(&self) -> u64 {
        self.records.offset()
    }

    /// How the file ends; none before its end was reached.
    pub(crate) fn ending(&self) -> Option<&Ending> {
        self.records.ending()
    }

    /// Goes on to the next message; false at the end of what can be read.
    ///
    /// # Errors
    /// [`Fault::Damaged`] when a chunk cannot be read; the next call goes on behind it, if that can be found.
    pub(crate) fn advance(&mut self) -> Result<bool, Fault> {
        self.place = None;
        while self.place.is_none() {
            if self.next_in_chunk()? {
                continue;
            }
            let Some(record) = self.records.next()? else { return Ok(false) };
            self.open(record)?;
        }
        Ok(true)
    }

    /// The message that was last gone on to.
    pub(crate) fn message(&self) -> Option<RawMessage<'_>> {
        let Place { channel, sequence, log_ns, stamp_ns, data } = self.place.as_ref()?;
        let channel = self.channels.get(channel)?;
        let data = self.chunk.get(data.clone())?;
        Some(RawMessage { channel, sequence: *sequence, stamp_ns: *stamp_ns, log_ns: *log_ns, data, offset: self.chunk_offset })
    }

    /// Makes the records of a chunk the current ones.
    fn open(&mut self, record: Record) -> Result<(), Damage> {
        self.chunk_offset = record.offset;
        self.cursor = 0;
        self.chunk.clear();
        match record.opcode {
            opcode::CHUNK => self.chunk = unpack(record.offset, &record.body).inspect_err(|_| self.records.distrust())?,
            // Not among what is written; one that is found is another record with a changed bit, and has no checksum.
            opcode::MESSAGE => return Err(damage(&record, "a message by itself", "messages in chunks")),
            // The index of what was read.
            _ => {}
        }
        Ok(())
    }

    /// Goes on to the next message of the current chunk; false when there is none.
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
                opcode::MESSAGE => place(&mut fields, end).map(|place| self.place = Some(place)),
                _ => Some(()),
            };
            if understood.is_none() {
                return Err(self.give_up(&format!("a record of type {opcode:#04x} that does not fit its length")));
            }
            self.cursor = end;
            if let Some(place) = &self.place {
                if self.channels.contains_key(&place.channel) {
                    return Ok(true);
                }
                let found = format!("a message of channel {}", place.channel);
                return Err(self.give_up(&found));
            }
        }
        Ok(false)
    }

    /// Leaves the rest of the current chunk.
    fn give_up(&mut self, found: &str) -> Damage {
        self.cursor = self.chunk.len();
        self.place = None;
        let expected = "whole records of schemas and channels, and messages of these channels".to_owned();
        Damage { offset: self.chunk_offset, found: format!("in the chunk there, {found}"), expected, skipped: 0 }
    }
}

/// A message whose bytes reach up to `end` of the chunk.
fn place(fields: &mut Fields<'_>, end: usize) -> Option<Place> {
    let (channel, sequence) = (fields.u16()?, fields.u32()?);
    let (log_ns, stamp_ns) = (fields.u64()?, fields.u64()?);
    Some(Place { channel, sequence, log_ns, stamp_ns, data: end - fields.0.len()..end })
}

/// Looks for settings and description in the whole file: tools that rewrite an MCAP file move them. `None` if one of them is missing.
///
/// # Errors
/// [`Fault::Foreign`] for an intact file that has neither, or as for a preamble at the start.
pub(crate) fn find_preamble(source: impl Read) -> Result<Option<Preamble>, Fault> {
    let mut records = RecordReader::new(source);
    let (mut library, mut settings, mut description) = (String::new(), None, None);
    while let Some(record) = records.next()? {
        match record.opcode {
            opcode::HEADER => library = header_library(&record.body).unwrap_or_default(),
            opcode::ATTACHMENT => settings = settings.or(settings_of(&record).ok()),
            opcode::METADATA => {
                if let Some((DESCRIPTION, entries)) = named_texts(&record.body) {
                    description = Some(entries);
                }
            }
            _ => {}
        }
    }
    match (settings, description) {
        (Some(settings), Some(description)) => Preamble::read(settings, &description).map(Some),
        (None, None) if records.ending() == Some(&Ending::Complete) => Err(Fault::Foreign { library }),
        _ => Ok(None),
    }
}

/// The library that a header names.
fn header_library(body: &[u8]) -> Option<String> {
    let mut fields = Fields(body);
    fields.text()?;
    fields.text().map(str::to_owned)
}

fn read_preamble(records: &mut RecordReader<impl Read>) -> Result<Preamble, Fault> {
    let mut settings = None;
    while let Some(record) = records.next()? {
        match record.opcode {
            opcode::HEADER => {}
            opcode::ATTACHMENT => settings = Some(settings_of(&record)?),
            opcode::METADATA => {
                let (Some(settings), Some((DESCRIPTION, entries))) = (settings, named_texts(&record.body)) else {
                    let expected = "the attachment settings.toml, then the description of the run";
                    return Err(damage(&record, "metadata", expected).into());
                };
                return Preamble::read(settings, &entries);
            }
            other => {
                let found = format!("a record of type {other:#04x}");
                return Err(damage(&record, &found, "the settings and the description of the run, before any message").into());
            }
        }
    }
    Err(match records.ending() {
        Some(Ending::Damaged(damage)) => damage.clone().into(),
        Some(Ending::Cut { offset }) => Fault::CutAtStart { offset: *offset },
        Some(Ending::Complete) | None => Fault::CutAtStart { offset: 0 },
    })
}
