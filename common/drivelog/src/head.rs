//! The settings and the description of the run in a file.

use std::collections::BTreeMap;
use std::io::{Read, Seek};

use crate::damage::{Damage, Fault};
use crate::deframer::opcode;
use crate::ending::Ending;
use crate::fields::Fields;
use crate::preamble::{DESCRIPTION, Preamble, SETTINGS, part_number};
use crate::records::{Record, RecordReader, damage, named_texts};

/// What a file says of its run and of itself.
pub(crate) struct Head {
    pub(crate) preamble: Preamble,
    /// The number of the part, unless an earlier version has written it.
    pub(crate) number: Option<u32>,
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
    /// A recorder writes the head first. Tools that rewrite a log may move it behind the messages: such a file is read to its head and then
    /// from its start again.
    pub(crate) fn read<R: Read + Seek>(source: R) -> Result<(Self, RecordReader<R>), Fault> {
        let mut records = RecordReader::new(source);
        let mut found = Found::default();
        let head = loop {
            match records.next() {
                Ok(Some(record)) => found.take(&record)?,
                Ok(None) => return Err(found.fault(records.ending())),
                // The reading of the messages reports it.
                Err(Fault::Damaged(_)) if found.is_behind_messages => {}
                Err(fault) => return Err(fault),
            }
            if let Found { settings: Some(settings), description: Some(entries), .. } = &mut found {
                let number = part_number(entries);
                break Self { preamble: Preamble::read(std::mem::take(settings), entries)?, number };
            }
        };
        if found.is_behind_messages {
            records = RecordReader::new(records.restart()?);
        }
        Ok((head, records))
    }
}

impl Found {
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
