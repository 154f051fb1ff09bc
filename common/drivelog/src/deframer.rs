//! From the bytes of an MCAP file to its records: pushed bytes, whatever their sizes.

use crc32fast::Hasher;

use crate::damage::Damage;
use crate::fields::Fields;

/// What an MCAP file starts and ends with.
pub(crate) const MAGIC: &[u8] = mcap::MAGIC;
/// Bytes before the body of a record: what it is, and its length.
const HEAD: usize = 9;
/// The largest record that is read; the largest that is written is a picture of the map.
pub(crate) const MAX_RECORD: u64 = 64 << 20;

/// The records that are read; the others are an index of them.
pub(crate) mod opcode {
    pub(crate) use mcap::records::op::{ATTACHMENT, CHANNEL, CHUNK, DATA_END, FOOTER, HEADER, MESSAGE, METADATA, SCHEMA};
}

/// A record of the file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Frame<'a> {
    /// Where it starts in the file.
    pub(crate) offset: u64,
    pub(crate) opcode: u8,
    pub(crate) body: &'a [u8],
}

/// Takes records out of a file from its start to its end.
pub(crate) struct Deframer {
    buffer: Vec<u8>,
    start: usize,
    offset: u64,
    stage: Stage,
    /// Over everything up to the end of the data section.
    crc: Option<Hasher>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Stage {
    FirstMagic,
    Records,
    LastMagic,
    Done,
    Lost,
}

impl Deframer {
    pub(crate) fn new() -> Self {
        Self { buffer: Vec::new(), start: 0, offset: 0, stage: Stage::FirstMagic, crc: Some(Hasher::new()) }
    }

    /// Takes the next bytes of the file.
    pub(crate) fn push(&mut self, bytes: &[u8]) {
        if self.start > self.buffer.len() / 2 {
            self.buffer.drain(..self.start);
            self.start = 0;
        }
        self.buffer.extend_from_slice(bytes);
    }

    /// Where in the file the record starts that is not yet whole.
    pub(crate) fn offset(&self) -> u64 {
        self.offset
    }

    /// Whether the file has ended as it should.
    pub(crate) fn is_done(&self) -> bool {
        self.stage == Stage::Done
    }

    /// The next record; `None` when more bytes are needed, or none can follow.
    ///
    /// # Errors
    /// Bytes that are no record; none can be found behind them.
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
        if self.stage != Stage::Records {
            return Ok(None);
        }
        let Some(length) = self.record_length()? else { return Ok(None) };
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
        self.start = end;
        self.offset += length as u64;
    }

    fn lost(&mut self, found: String, expected: impl Into<String>) -> Damage {
        self.stage = Stage::Lost;
        Damage { offset: self.offset, found, expected: expected.into() }
    }

    /// Goes on to `then` behind the magic bytes; false when they are not all there yet.
    fn magic(&mut self, then: Stage) -> Result<bool, Damage> {
        let there = self.waiting().len().min(MAGIC.len());
        let found = &self.waiting()[..there];
        if found != &MAGIC[..there] {
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

    /// Length of the next record with its head; `None` when it is not yet whole.
    fn record_length(&mut self) -> Result<Option<usize>, Damage> {
        let Some(&opcode) = self.waiting().first() else { return Ok(None) };
        if opcode == 0 || (opcode > opcode::DATA_END && opcode < 0x80) {
            return Err(self.lost(format!("a record of type {opcode:#04x}"), "one of MCAP's, 0x01 to 0x0f"));
        }
        let Some(length) = Fields(&self.waiting()[1..]).u64() else { return Ok(None) };
        if length > MAX_RECORD {
            return Err(self.lost(format!("a record of {length} bytes"), format!("at most {MAX_RECORD}")));
        }
        let whole = HEAD + length as usize;
        Ok((self.waiting().len() >= whole).then_some(whole))
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

/// The first record of a chunk's content, and what follows it; `None` when the bytes are no whole record.
pub(crate) fn split_record(bytes: &[u8]) -> Option<(u8, &[u8], &[u8])> {
    let mut fields = Fields(bytes.get(1..)?);
    let length = fields.u64()?;
    let body = fields.bytes(length)?;
    Some((bytes[0], body, fields.0))
}
