//! The records of a file and their fields.

use std::collections::BTreeMap;
use std::io::{self, ErrorKind, Read, Seek, SeekFrom};

use crate::damage::{Damage, Fault};
use crate::deframer::{Deframer, Frame};
use crate::ending::Ending;
use crate::fields::Fields;
use crate::logged::Format;

/// Bytes that are read at a time.
const READ: usize = 256 << 10;

/// A record at the top of the file.
pub(crate) struct Record {
    /// Where it starts in the file.
    pub(crate) offset: u64,
    pub(crate) opcode: u8,
    pub(crate) body: Vec<u8>,
}

/// A topic of the file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Channel {
    /// The topic: the name of a service, or of something that was derived for people.
    pub topic: String,
    /// What its messages are.
    pub format: Format,
}

/// What the messages of a channel are.
#[derive(Debug, Clone, Default)]
pub(crate) struct Schema {
    name: String,
    encoding: String,
    data: Vec<u8>,
}

/// Reads a file record by record.
pub(crate) struct RecordReader<R> {
    source: R,
    read: Vec<u8>,
    deframer: Deframer,
    ending: Option<Ending>,
}

impl<R: Read> RecordReader<R> {
    pub(crate) fn new(source: R) -> Self {
        Self { source, read: vec![0; READ], deframer: Deframer::new(), ending: None }
    }

    /// Bytes of the file that have been read as records.
    pub(crate) fn offset(&self) -> u64 {
        self.deframer.offset()
    }

    /// How the file ends; none before its end was reached.
    pub(crate) fn ending(&self) -> Option<&Ending> {
        self.ending.as_ref()
    }

    /// The next record; `None` at the end of the file.
    ///
    /// # Errors
    /// When the source cannot be read, or records are lost; the next call continues behind them.
    pub(crate) fn next(&mut self) -> Result<Option<Record>, Fault> {
        while self.ending.is_none() {
            let own = |frame: Frame<'_>| Record { offset: frame.offset, opcode: frame.opcode, body: frame.body.to_vec() };
            match self.deframer.next().map(|frame| frame.map(own)) {
                Ok(Some(record)) => return Ok(Some(record)),
                Ok(None) if self.deframer.has_ended() => self.ending = Some(self.deframer.ending()),
                Ok(None) => {
                    if let Err(error) = self.read() {
                        // A disk that fails here fails again: a reader that continues behind the error finds the end.
                        self.ending = Some(Ending::Cut { offset: self.deframer.offset() });
                        return Err(error);
                    }
                }
                Err(damage) if self.deframer.is_lost() => self.ending = Some(Ending::Damaged(damage)),
                Err(damage) => return Err(damage.into()),
            }
        }
        Ok(None)
    }

    /// The last record is a chunk that cannot be read: what follows it need not begin where that says.
    pub(crate) fn distrust(&mut self) {
        self.deframer.distrust();
    }

    /// The source, at its start again.
    pub(crate) fn restart(mut self) -> io::Result<R>
    where
        R: Seek,
    {
        self.source.rewind()?;
        Ok(self.source)
    }

    /// What is read, at any place: [`continue_at`](Self::continue_at) finds the next record.
    pub(crate) fn source(&mut self) -> &mut R {
        &mut self.source
    }

    /// Continues with the record that starts here.
    pub(crate) fn continue_at(&mut self, offset: u64) -> io::Result<()>
    where
        R: Seek,
    {
        self.source.seek(SeekFrom::Start(offset))?;
        self.deframer = Deframer::at(offset);
        self.ending = None;
        Ok(())
    }

    fn read(&mut self) -> Result<(), Fault> {
        match self.source.read(&mut self.read) {
            Ok(0) => self.deframer.end(),
            Ok(count) => self.deframer.push(&self.read[..count]),
            Err(error) if error.kind() == ErrorKind::Interrupted => {}
            Err(error) => return Err(error.into()),
        }
        Ok(())
    }
}

pub(crate) fn damage(record: &Record, found: &str, expected: &str) -> Damage {
    Damage { offset: record.offset, found: found.to_owned(), expected: expected.to_owned(), skipped: 0 }
}

/// A metadata record.
pub(crate) fn named_texts(body: &[u8]) -> Option<(&str, BTreeMap<String, String>)> {
    let mut fields = Fields(body);
    Some((fields.text()?, fields.texts()?))
}

/// A schema with its number.
pub(crate) fn schema(fields: &mut Fields<'_>) -> Option<(u16, Schema)> {
    let id = fields.u16()?;
    let name = fields.text()?.to_owned();
    let encoding = fields.text()?.to_owned();
    let length = fields.u32()?;
    Some((id, Schema { name, encoding, data: fields.bytes(length.into())?.to_vec() }))
}

/// A channel with its number.
pub(crate) fn channel(fields: &mut Fields<'_>, schemas: &BTreeMap<u16, Schema>) -> Option<(u16, Channel)> {
    let id = fields.u16()?;
    let schema = schemas.get(&fields.u16()?).cloned().unwrap_or_default();
    let topic = fields.text()?.to_owned();
    let message_encoding = fields.text()?.to_owned();
    let format = Format { schema_name: schema.name, schema_encoding: schema.encoding, schema: schema.data, message_encoding };
    Some((id, Channel { topic, format }))
}

#[cfg(test)]
mod tests {
    use super::*;

    struct FailingDisk;

    impl Read for FailingDisk {
        fn read(&mut self, _: &mut [u8]) -> io::Result<usize> {
            Err(io::Error::other("the disk fails"))
        }
    }

    #[test]
    fn a_file_ends_where_its_disk_fails() {
        let mut records = RecordReader::new(FailingDisk);
        assert!(matches!(records.next(), Err(Fault::Io(_))));
        assert!(matches!(records.next(), Ok(None)));
        assert_eq!(records.ending(), Some(&Ending::Cut { offset: 0 }));
    }
}
