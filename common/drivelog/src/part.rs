//! One file of a log, read from its start.

use std::io::{self, Read, Seek};

use crate::damage::Fault;
use crate::ending::Ending;
use crate::head::Head;
use crate::message_reader::{MessageReader, RawMessage};
use crate::preamble::Preamble;

/// Reads the messages of one file in the order in which they were written.
pub(crate) struct PartReader<R> {
    head: Head,
    messages: MessageReader<R>,
}

impl<R: Read + Seek> PartReader<R> {
    /// Reads the settings and the description of the run.
    pub(crate) fn new(source: R) -> Result<Self, Fault> {
        let (head, records) = Head::read(source)?;
        Ok(Self { head, messages: MessageReader::new(records) })
    }

    pub(crate) fn preamble(&self) -> &Preamble {
        &self.head.preamble
    }

    /// The number of the part, unless an earlier version has written it.
    pub(crate) fn number(&self) -> Option<u32> {
        self.head.number
    }

    /// Parts up to this number may have been removed on purpose.
    pub(crate) fn removed(&self) -> u32 {
        self.head.removed
    }

    /// Whether the file says that another part follows. It says so at its end.
    pub(crate) fn continues(&self) -> bool {
        self.messages.continues()
    }

    /// Bytes of the file that have been read.
    pub(crate) fn offset(&self) -> u64 {
        self.messages.offset()
    }

    /// How the file ends; none before its end was reached.
    pub(crate) fn ending(&self) -> Option<&Ending> {
        self.messages.ending()
    }

    /// Makes the next message the current one, as [`MessageReader::advance`].
    ///
    /// # Errors
    /// As [`MessageReader::advance`].
    pub(crate) fn advance(&mut self) -> Result<bool, Fault> {
        self.messages.advance()
    }

    /// Passes over what is earlier, as [`MessageReader::skip_to`].
    ///
    /// # Errors
    /// As [`MessageReader::skip_to`].
    pub(crate) fn skip_to(&mut self, from_ns: u64) -> io::Result<bool> {
        self.messages.skip_to(from_ns)
    }

    /// The current message.
    pub(crate) fn message(&self) -> Option<RawMessage<'_>> {
        self.messages.message()
    }
}
