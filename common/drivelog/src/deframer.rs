//! From the bytes of an MCAP file, pushed in pieces of any size, to its records.

use crc32fast::Hasher;

use crate::chunk::{MAX_RECORD, unpack};
use crate::damage::Damage;
use crate::ending::Ending;
use crate::fields::Fields;

/// What an MCAP file starts and ends with.
pub(crate) const MAGIC: &[u8] = mcap::MAGIC;
/// Bytes before the body of a record: what it is, and its length.
const HEAD: usize = 9;
/// Bytes of a data end: its checksum.
const DATA_END: u64 = 4;
/// Bytes of a chunk without its content and the word for how it is packed: three times and sizes, a checksum, two lengths.
const CHUNK_FIELDS: u64 = 8 + 8 + 8 + 4 + 4 + 8;
/// Bytes that may be unpacked in vain in the search for intact chunks, and how many more for each byte of the file: the time to read
/// any file grows with its size only.
const IN_VAIN: u64 = 4 * MAX_RECORD;
const IN_VAIN_PER_BYTE: u64 = 16;

/// Most bytes of a file of zeros, which a power cut leaves of a file that was just made: what is written until the first flush.
const MOST_ZEROS: usize = 1024 * 1024;

/// The records that are read; most of the others are an index of them.
pub(crate) mod opcode {
    pub(crate) use mcap::records::op::{ATTACHMENT, CHANNEL, CHUNK, CHUNK_INDEX, DATA_END, FOOTER, HEADER, MESSAGE, METADATA, SCHEMA};
}

/// A record of the file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Frame<'a> {
    /// Where it starts in the file.
    pub(crate) offset: u64,
    pub(crate) opcode: u8,
    pub(crate) body: &'a [u8],
}

/// Takes records out of a file from its start to its end. Where bytes are no record, it searches the next intact chunk.
pub(crate) struct Deframer {
    buffer: Vec<u8>,
    start: usize,
    offset: u64,
    stage: Stage,
    /// No more bytes will come.
    at_end: bool,
    /// Size of the last record with its head.
    last: usize,
    /// Reason and start of the search for an intact chunk.
    gap: Option<Gap>,
    /// Bytes that may still be unpacked in vain.
    in_vain: u64,
    /// Over everything up to the end of the data section.
    crc: Option<Hasher>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Stage {
    FirstMagic,
    Records,
    LastMagic,
    Done,
    /// The rest is not read.
    Lost,
    /// Search for an intact chunk.
    Search,
}

/// Bytes that are passed over.
#[derive(Debug, Clone, PartialEq, Eq)]
struct Gap {
    offset: u64,
    reason: Reason,
    /// All of them so far are zeros.
    is_zeros: bool,
}

#[derive(Debug, Clone, PartialEq, Eq)]
enum Reason {
    /// What stands there is no record: found, expected.
    NoRecord(String, String),
    /// The record is incomplete at the end of the file, and its length may be damaged.
    Cut,
    /// The chunk cannot be read, which has been reported.
    Chunk,
}

/// What the bytes at a place of the search may be.
enum Guess {
    Nothing,
    /// More bytes decide.
    Unclear,
    /// A chunk of this length with its head, and of this size unpacked.
    Chunk(usize, u64),
    DataEnd,
}

impl Deframer {
    pub(crate) fn new() -> Self {
        Self {
            buffer: Vec::new(),
            start: 0,
            offset: 0,
            stage: Stage::FirstMagic,
            at_end: false,
            last: 0,
            gap: None,
            in_vain: IN_VAIN,
            crc: Some(Hasher::new()),
        }
    }

    /// For a file that is read from a record on.
    pub(crate) fn at(offset: u64) -> Self {
        Self { offset, stage: Stage::Records, crc: None, ..Self::new() }
    }

    /// Takes the next bytes of the file.
    pub(crate) fn push(&mut self, bytes: &[u8]) {
        if self.start > self.buffer.len() / 2 {
            self.buffer.drain(..self.start);
            self.start = 0;
        }
        self.buffer.extend_from_slice(bytes);
    }

    /// Offset of the record that is not yet complete.
    pub(crate) fn offset(&self) -> u64 {
        self.offset
    }

    /// No more bytes will come.
    pub(crate) fn end(&mut self) {
        self.at_end = true;
    }

    pub(crate) fn has_ended(&self) -> bool {
        self.at_end
    }

    /// Whether nothing of what follows is looked at.
    pub(crate) fn is_lost(&self) -> bool {
        self.stage == Stage::Lost
    }

    /// How the file has ended, of which no more bytes will come.
    pub(crate) fn ending(&self) -> Ending {
        match &self.gap {
            _ if self.stage == Stage::Done => Ending::Complete,
            Some(Gap { offset, reason: Reason::Cut | Reason::Chunk, .. }) => Ending::Cut { offset: *offset },
            // A power cut leaves a file with its length on the disk, and zeros where its last bytes were not there yet.
            Some(Gap { offset, is_zeros: true, .. }) if is_zeros(self.waiting()) => Ending::Cut { offset: *offset },
            Some(gap) => gap.damage(self.offset + self.waiting().len() as u64).map_or(Ending::Complete, Ending::Damaged),
            None => Ending::Cut { offset: self.offset },
        }
    }

    /// The last record is a chunk that cannot be read. Its length may be damaged: the search for the next intact chunk begins at its
    /// second byte. Only before more bytes come.
    pub(crate) fn distrust(&mut self) {
        let Some(first) = self.start.checked_sub(self.last).filter(|_| self.stage == Stage::Records) else { return };
        if !self.spend(self.last as u64 + unpacked_size(&self.buffer[first..self.start])) {
            return;
        }
        self.start = first;
        self.offset -= self.last as u64;
        self.search(Reason::Chunk);
        self.skip(1);
    }

    /// The next record; `None` when more bytes are needed, or none can follow.
    ///
    /// # Errors
    /// Bytes that are no record. If it [is lost](Self::is_lost) then, none can be found behind them; otherwise the next call continues
    /// with the next intact chunk.
    pub(crate) fn next(&mut self) -> Result<Option<Frame<'_>>, Damage> {
        if self.stage == Stage::FirstMagic && !self.magic(Stage::Records)? {
            return Ok(None);
        }
        if self.stage == Stage::LastMagic {
            self.magic(Stage::Done)?;
        }
        if self.stage == Stage::Done && !self.waiting().is_empty() {
            return Err(self.lost(format!("{} more bytes", self.waiting().len()), "the end of the file"));
        }
        if self.stage == Stage::Records {
            match self.check_head() {
                Err(reason) => self.search(reason),
                Ok(()) if self.at_end && !self.waiting().is_empty() && self.record_length().is_none() => {
                    self.search(Reason::Cut);
                    self.skip(1);
                }
                Ok(()) => {}
            }
        }
        if self.stage == Stage::Search && self.find_chunk() {
            self.stage = Stage::Records;
            if let Some(damage) = self.gap.take().and_then(|gap| gap.damage(self.offset)) {
                return Err(damage);
            }
        }
        if self.stage != Stage::Records {
            return Ok(None);
        }
        let Some(length) = self.record_length() else { return Ok(None) };
        let (from, offset) = (self.start, self.offset);
        let opcode = self.buffer[from];
        let body = from + HEAD..from + length;
        match opcode {
            opcode::DATA_END => self.check_data(body.start)?,
            opcode::FOOTER => self.stage = Stage::LastMagic,
            _ => {}
        }
        self.advance(length);
        Ok(Some(Frame { offset, opcode, body: &self.buffer[body] }))
    }

    fn waiting(&self) -> &[u8] {
        &self.buffer[self.start..]
    }

    fn advance(&mut self, length: usize) {
        let end = self.start + length;
        if let Some(crc) = &mut self.crc {
            crc.update(&self.buffer[self.start..end]);
        }
        (self.start, self.last) = (end, length);
        self.offset += length as u64;
    }

    /// Passes over bytes in which nothing was found.
    fn skip(&mut self, length: usize) {
        if let Some(gap) = &mut self.gap {
            gap.is_zeros &= is_zeros(&self.buffer[self.start..self.start + length]);
        }
        self.start += length;
        self.offset += length as u64;
        self.in_vain = self.in_vain.saturating_add(IN_VAIN_PER_BYTE * length as u64);
    }

    /// Whether so many bytes may be unpacked in vain, which they have been.
    fn spend(&mut self, bytes: u64) -> bool {
        let left = self.in_vain.checked_sub(bytes);
        self.in_vain = left.unwrap_or_default();
        left.is_some()
    }

    /// Begins the search for an intact chunk here. The checksum of all data does not apply any more.
    fn search(&mut self, reason: Reason) {
        self.stage = Stage::Search;
        self.gap = Some(Gap { offset: self.offset, reason, is_zeros: true });
        self.crc = None;
    }

    /// Advances to the next intact chunk or to the end of the data; false when it is not complete yet, or there is none.
    fn find_chunk(&mut self) -> bool {
        loop {
            let waiting = self.waiting();
            let skipped = waiting.iter().position(|byte| [opcode::CHUNK, opcode::DATA_END].contains(byte));
            self.skip(skipped.unwrap_or(waiting.len()));
            match guess(self.waiting()) {
                Guess::DataEnd => return true,
                Guess::Chunk(length, size) => {
                    if unpack(self.offset, &self.waiting()[HEAD..length]).is_ok() {
                        return true;
                    }
                    if !self.spend(length as u64 + size) {
                        self.stage = Stage::Lost;
                        return false;
                    }
                }
                Guess::Unclear if !self.at_end || self.waiting().is_empty() => return false,
                Guess::Unclear | Guess::Nothing => {}
            }
            self.skip(1);
        }
    }

    fn lost(&mut self, found: String, expected: impl Into<String>) -> Damage {
        self.stage = Stage::Lost;
        Damage { offset: self.offset, found, expected: expected.into(), skipped: 0 }
    }

    /// Advances to `then` behind the magic bytes; false when they are not complete yet.
    fn magic(&mut self, then: Stage) -> Result<bool, Damage> {
        let there = self.waiting().len().min(MAGIC.len());
        let found = &self.waiting()[..there];
        if found != &MAGIC[..there] {
            if then == Stage::Records && self.waiting().len() <= MOST_ZEROS && is_zeros(self.waiting()) {
                return Ok(false);
            }
            let found = format!("{found:02x?}");
            return Err(self.lost(found, format!("the magic bytes of an MCAP file {MAGIC:02x?}")));
        }
        if there < MAGIC.len() {
            return Ok(false);
        }
        self.advance(there);
        self.stage = then;
        Ok(true)
    }

    /// Whether the next record can be one, as far as its head is there.
    fn check_head(&self) -> Result<(), Reason> {
        let Some(&opcode) = self.waiting().first() else { return Ok(()) };
        if opcode == 0 || (opcode > opcode::DATA_END && opcode < 0x80) {
            return Err(Reason::NoRecord(format!("a record of type {opcode:#04x}"), "one of MCAP's, 0x01 to 0x0f".to_owned()));
        }
        match Fields(&self.waiting()[1..]).u64() {
            Some(length) if length > MAX_RECORD => {
                Err(Reason::NoRecord(format!("a record of {length} bytes"), format!("at most {MAX_RECORD}")))
            }
            _ => Ok(()),
        }
    }

    /// Length of the next record with its head; `None` when it is not yet complete.
    fn record_length(&self) -> Option<usize> {
        let length = Fields(self.waiting().get(1..)?).u64()?;
        let complete = HEAD + length as usize;
        (self.waiting().len() >= complete).then_some(complete)
    }

    /// Compares the checksum of everything before the end of the data section with what that says.
    fn check_data(&mut self, body: usize) -> Result<(), Damage> {
        let calculated = self.crc.take().map(Hasher::finalize);
        let saved = self.buffer.get(body..).and_then(|bytes| Fields(bytes).u32());
        match (calculated, saved) {
            (Some(calculated), Some(saved)) if saved != 0 && saved != calculated => {
                Err(self.lost(format!("checksum {saved:08x} of everything before"), format!("{calculated:08x}, as it is")))
            }
            _ => Ok(()),
        }
    }
}

impl Gap {
    /// The damage to report when it reaches up to `end`; `None` when it has been reported.
    fn damage(&self, end: u64) -> Option<Damage> {
        let (found, expected) = match &self.reason {
            Reason::NoRecord(found, expected) => (found.clone(), expected.clone()),
            Reason::Cut => ("a record that reaches beyond the end of the file".to_owned(), "one within it".to_owned()),
            Reason::Chunk => return None,
        };
        Some(Damage { offset: self.offset, found, expected, skipped: end.saturating_sub(self.offset) })
    }
}

fn is_zeros(bytes: &[u8]) -> bool {
    bytes.iter().all(|byte| *byte == 0)
}

/// Size that the chunk of a record says that it has unpacked.
fn unpacked_size(record: &[u8]) -> u64 {
    let size = record.get(HEAD + 16..).and_then(|bytes| Fields(bytes).u64());
    size.unwrap_or_default().min(MAX_RECORD)
}

/// What bytes may be that begin as a chunk or a data end does, by their head alone.
fn guess(bytes: &[u8]) -> Guess {
    let mut fields = Fields(bytes);
    let mut head = || {
        let opcode = fields.bytes(1)?[0];
        let length = fields.u64()?;
        if opcode == opcode::DATA_END {
            return Some(if length == DATA_END { Guess::DataEnd } else { Guess::Nothing });
        }
        fields.bytes(16)?;
        let size = fields.u64()?;
        fields.u32()?;
        let word = u64::from(fields.u32()?);
        if length > MAX_RECORD || size > MAX_RECORD || word > 3 {
            return Some(Guess::Nothing);
        }
        let fits = fields.bytes(word)?.is_empty() || word == 3;
        let packed = fields.u64()?;
        if !fits || packed.checked_add(CHUNK_FIELDS + word) != Some(length) {
            return Some(Guess::Nothing);
        }
        let complete = HEAD + length as usize;
        Some(if bytes.len() < complete { Guess::Unclear } else { Guess::Chunk(complete, size) })
    };
    head().unwrap_or(Guess::Unclear)
}

/// The first record of a chunk's content, and what follows it; `None` when the bytes are no complete record.
pub(crate) fn split_record(bytes: &[u8]) -> Option<(u8, &[u8], &[u8])> {
    let mut fields = Fields(bytes.get(1..)?);
    let length = fields.u64()?;
    let body = fields.bytes(length)?;
    Some((bytes[0], body, fields.0))
}
