//! MCAP files of other programs.

use std::fs::File;
use std::io::Seek;
use std::path::{Path, PathBuf};

use crate::damage::LogError;
use crate::ending::Ending;
use crate::message_reader::{MessageReader, RawMessage};
use crate::records::RecordReader;
use crate::summary::Summary;

/// Reads the messages of an MCAP file of any program, in the order in which they were written.
pub struct McapReader {
    path: PathBuf,
    messages: MessageReader<File>,
    /// The damage at which the file ends has been returned.
    has_failed: bool,
}

impl McapReader {
    /// Opens a file.
    ///
    /// # Errors
    /// When it cannot be opened.
    pub fn open(path: &Path) -> Result<Self, LogError> {
        let mut file = File::open(path).map_err(LogError::at(path))?;
        // Some programs name a topic in the first chunk that has it, and again only at the end: the chunk may be damaged.
        let Summary { topics, .. } = Summary::read(&mut file).map_err(LogError::at(path))?;
        file.rewind().map_err(LogError::at(path))?;
        Ok(Self { path: path.to_owned(), messages: MessageReader::with_topics(RecordReader::new(file), topics), has_failed: false })
    }

    /// Makes the next message the current one; false at the end of what can be read.
    ///
    /// # Errors
    /// When something cannot be read; the next call continues behind it.
    pub fn advance(&mut self) -> Result<bool, LogError> {
        let has_message = self.messages.advance().map_err(LogError::at(&self.path))?;
        match self.messages.ending() {
            Some(Ending::Damaged(damage)) if !has_message && !std::mem::replace(&mut self.has_failed, true) => {
                Err(LogError::at(&self.path)(damage.clone()))
            }
            _ => Ok(has_message),
        }
    }

    /// The current message.
    #[must_use]
    pub fn message(&self) -> Option<RawMessage<'_>> {
        self.messages.message()
    }

    /// Where the file breaks off, bytes; `None` before its end, or when it is complete.
    #[must_use]
    pub fn cut_at(&self) -> Option<u64> {
        match self.messages.ending() {
            Some(Ending::Cut { offset }) => Some(*offset),
            _ => None,
        }
    }
}
