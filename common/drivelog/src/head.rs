//! The settings and the description of the run in a file.

use std::collections::BTreeMap;
use std::io::{Read, Seek, SeekFrom};

use crate::chunk::MAX_RECORD;
use crate::damage::{Damage, Fault};
use crate::deframer::{MAGIC, opcode};
use crate::ending::Ending;
use crate::fields::Fields;
use crate::preamble::{DESCRIPTION, Preamble, SETTINGS, part_number, removed_parts};
use crate::records::{Record, RecordReader, damage, named_texts};

/// What a file says of its run and of itself.
pub(crate) struct Head {
    pub(crate) preamble: Preamble,
    /// The number of the part, unless an earlier version has written it.
    pub(crate) number: Option<u32>,
    /// Parts up to this number may have been removed on purpose.
    pub(crate) removed: u32,
}

/// The records of which a head is made, as far as they are found.
#[derive(Default)]
struct Found {
    settings: Option<String>,
    description: Option<BTreeMap<String, String>>,
    /// The library that has written the file and the profile of its messages, for another program's file.
    origin: (String, String),
    /// Records of messages come before the head is complete.
    is_behind_messages: bool,
}

impl Head {
    /// Reads the head, and leaves the reader before the first message.
    ///
    /// A recorder writes the head first. Tools that rewrite a log may move it behind the messages: such a file is searched for its head and
    /// then read from its start.
    pub(crate) fn read<R: Read + Seek>(source: R) -> Result<(Self, RecordReader<R>), Fault> {
        let mut records = RecordReader::new(source);
        let (mut found, mut has_skipped) = (Found::default(), false);
        let head = loop {
            match records.next() {
                Ok(Some(record)) => found.take(&record)?,
                Ok(None) => return Err(found.fault(records.ending())),
                // The reading of the messages reports it.
                Err(Fault::Damaged(_)) if found.is_behind_messages => {}
                Err(fault) => return Err(fault),
            }
            if found.is_behind_messages && !has_skipped {
                has_skipped = true;
                let mut source = records.restart()?;
                if found.skip_messages(&mut source)? == Skipped::ToTheEnd && !found.is_complete() {
                    return Err(found.fault(Some(&Ending::Complete)));
                }
                source.rewind()?;
                records = RecordReader::new(source);
            }
            if let Found { settings: Some(settings), description: Some(entries), .. } = &mut found {
                let (number, removed) = (part_number(entries), removed_parts(entries));
                break Self { preamble: Preamble::read(std::mem::take(settings), entries)?, number, removed };
            }
        };
        if found.is_behind_messages {
            records = RecordReader::new(records.restart()?);
        }
        Ok((head, records))
    }
}

/// How far messages could be skipped.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Skipped {
    /// To the end of the data, by the lengths of the records.
    ToTheEnd,
    /// To a record that is incomplete or has no valid length.
    ToDamage,
}

impl Found {
    fn is_complete(&self) -> bool {
        self.settings.is_some() && self.description.is_some()
    }

    /// Looks for the head from record to record and reads no messages: a long log would take longer than a process may be silent.
    fn skip_messages(&mut self, source: &mut (impl Read + Seek)) -> Result<Skipped, Fault> {
        let mut offset = source.seek(SeekFrom::Start(MAGIC.len() as u64))?;
        while !self.is_complete() {
            let mut start = Vec::new();
            source.by_ref().take(9).read_to_end(&mut start)?;
            let Some((opcode, length)) = start.split_first().and_then(|(opcode, length)| Some((*opcode, Fields(length).u64()?))) else {
                return Ok(Skipped::ToDamage);
            };
            match opcode {
                opcode::DATA_END => return Ok(Skipped::ToTheEnd),
                opcode::ATTACHMENT | opcode::METADATA if length <= MAX_RECORD => {
                    let mut body = Vec::new();
                    if source.by_ref().take(length).read_to_end(&mut body)? as u64 != length {
                        return Ok(Skipped::ToDamage);
                    }
                    self.take(&Record { offset, opcode, body })?;
                }
                0 | 0x10..0x80 => return Ok(Skipped::ToDamage),
                _ if length > MAX_RECORD => return Ok(Skipped::ToDamage),
                _ => source.seek_relative(length as i64)?,
            }
            offset += 9 + length;
        }
        Ok(Skipped::ToTheEnd)
    }

    fn take(&mut self, record: &Record) -> Result<(), Damage> {
        match record.opcode {
            opcode::HEADER => {
                let mut fields = Fields(&record.body);
                let profile = fields.text().unwrap_or_default().to_owned();
                self.origin = (fields.text().unwrap_or_default().to_owned(), profile);
            }
            opcode::ATTACHMENT => match attachment(record)? {
                (name, content) if name == SETTINGS => {
                    let settings = String::from_utf8(content).map_err(|_| damage(record, "settings that are not UTF-8", "TOML"))?;
                    self.settings = Some(settings);
                }
                _ => {}
            },
            opcode::METADATA => {
                if let Some((DESCRIPTION, entries)) = named_texts(&record.body) {
                    self.description = Some(entries);
                }
            }
            opcode::CHUNK | opcode::MESSAGE | opcode::SCHEMA | opcode::CHANNEL => self.is_behind_messages = true,
            _ => {}
        }
        Ok(())
    }

    /// Why a file with this ending has no head.
    fn fault(self, ending: Option<&Ending>) -> Fault {
        let (library, profile) = self.origin;
        match ending {
            Some(Ending::Damaged(damage)) if !self.is_behind_messages => damage.clone().into(),
            Some(Ending::Cut { offset }) if !self.is_behind_messages => Fault::CutAtStart { offset: *offset },
            _ => Fault::Foreign { library, profile },
        }
    }
}

/// Name and content of an attachment.
fn attachment(record: &Record) -> Result<(String, Vec<u8>), Damage> {
    let wrong = |found: &str| damage(record, found, "an attachment with its checksum");
    let mut fields = Fields(&record.body);
    let parse = |fields: &mut Fields<'_>| {
        fields.u64()?;
        fields.u64()?;
        let name = fields.text()?.to_owned();
        fields.text()?;
        let length = fields.u64()?;
        Some((name, fields.bytes(length)?.to_vec()))
    };
    let parsed = parse(&mut fields).ok_or_else(|| wrong("an attachment that does not fit its length"))?;
    let covered = &record.body[..record.body.len() - fields.0.len()];
    let calculated = crc32fast::hash(covered);
    match fields.u32() {
        // 0 stands for no checksum.
        Some(saved) if saved == calculated || saved == 0 => Ok(parsed),
        saved => Err(wrong(&format!("checksum {:08x} instead of {calculated:08x}", saved.unwrap_or_default()))),
    }
}

#[cfg(test)]
mod tests {
    use std::cell::Cell;
    use std::collections::BTreeMap;
    use std::io::{self, Cursor};
    use std::rc::Rc;

    use mcap::records::MessageHeader;

    use super::*;

    /// Counts the bytes that are read.
    struct Counting(Cursor<Vec<u8>>, Rc<Cell<usize>>);

    impl Read for Counting {
        fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
            let count = self.0.read(buffer)?;
            self.1.set(self.1.get() + count);
            Ok(count)
        }
    }

    impl Seek for Counting {
        fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
            self.0.seek(to)
        }
    }

    #[test]
    fn a_search_for_the_head_skips_the_messages() {
        const MEGABYTES: usize = 8;
        let preamble = Preamble {
            run: 1,
            robot: "x".to_owned(),
            sonars: Vec::new(),
            origin: "a test".to_owned(),
            settings: "name = \"x\"".to_owned(),
        };
        for has_head in [true, false] {
            let mut writer = mcap::WriteOptions::new().compression(None).create(Cursor::new(Vec::new())).unwrap();
            let channel_id = writer.add_channel(0, "data", "raw", &BTreeMap::new()).unwrap();
            for sequence in 1..=MEGABYTES {
                let header = MessageHeader { channel_id, sequence: sequence as u32, log_time: 1, publish_time: 1 };
                writer.write_to_known_channel(&header, &vec![7; 1 << 20]).unwrap();
            }
            if has_head {
                writer.write_metadata(&preamble.metadata(1, 0)).unwrap();
                writer.attach(&preamble.attachment()).unwrap();
            }
            writer.finish().unwrap();
            let read = Rc::new(Cell::new(0));
            match Head::read(Counting(Cursor::new(writer.into_inner().into_inner()), Rc::clone(&read))) {
                Ok((head, _)) => assert!(has_head && head.preamble == preamble),
                Err(fault) => assert!(!has_head && matches!(fault, Fault::Foreign { .. }), "{fault}"),
            }
            // The first message is read as a record before the search begins.
            assert!(read.get() < 3 << 20, "{} bytes", read.get());
        }
    }
}
