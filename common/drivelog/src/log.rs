//! A log of one or more files, read as one.

use std::collections::{BTreeMap, VecDeque};
use std::fs::File;
use std::path::{Path, PathBuf};

use messages::{Pictures, Service};

use crate::damage::{Fault, LogError};
use crate::decode_error::DecodeError;
use crate::ending::Ending;
use crate::image::{self, Image};
use crate::logged::Logged;
use crate::part::{PartReader, RawMessage, find_preamble};
use crate::parts::following_parts;
use crate::preamble::Preamble;
use crate::views::PoseView;
use crate::writer::{END_TOPIC, End};

/// What a log holds of one stream.
#[derive(Debug, Clone, PartialEq)]
pub enum Entry<T> {
    /// A message.
    Message {
        /// Its sequence number.
        seq: u64,
        /// Its stamp.
        stamp_ns: u64,
        /// What it says.
        payload: T,
    },
    /// The stream ends.
    End {
        /// Its last message.
        seq: u64,
        /// When.
        stamp_ns: u64,
    },
}

/// A file of a log, and what became of reading it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Part {
    /// The file.
    pub path: PathBuf,
    /// Its size.
    pub bytes: u64,
    /// What became of it.
    pub outcome: Outcome,
}

/// What became of reading a file of a log.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Outcome {
    /// It was read up to this end.
    Read(Ending),
    /// It ends before its first message.
    Empty,
    /// It is left out: it belongs to another run.
    OtherRun(u64),
}

/// Reads a log in the order in which it was written; the parts that follow its first file are taken along.
pub struct Log {
    preamble: Preamble,
    current: Option<(PathBuf, u64, PartReader<File>)>,
    waiting: VecDeque<PathBuf>,
    /// Size of the files that wait, bytes.
    waiting_bytes: u64,
    parts: Vec<Part>,
    /// The last message of each numbered stream: a restarted recorder is given again what it had before.
    last: BTreeMap<String, u32>,
}

impl Log {
    /// Opens a log by its first file.
    ///
    /// # Errors
    /// When the file cannot be read, is no log, or is cut before its first message and nothing follows it.
    pub fn open(path: &Path) -> Result<Self, LogError> {
        let following = following_parts(path).map_err(LogError::at(path))?;
        let mut waiting: VecDeque<PathBuf> = following.into_iter().map(|(_, part)| part).collect();
        let mut parts = Vec::new();
        let mut path = path.to_owned();
        loop {
            let (bytes, file) = open(&path)?;
            match read_part(&path, file) {
                Ok(reader) => {
                    let preamble = reader.preamble().clone();
                    let waiting_bytes = waiting.iter().filter_map(|path| path.metadata().ok()).map(|file| file.len()).sum();
                    let current = Some((path, bytes, reader));
                    return Ok(Self { preamble, current, waiting, waiting_bytes, parts, last: BTreeMap::new() });
                }
                Err(fault @ Fault::CutAtStart { .. }) => {
                    let Some(following) = waiting.pop_front() else { return Err(LogError::at(&path)(fault)) };
                    parts.push(Part { path, bytes, outcome: Outcome::Empty });
                    path = following;
                }
                Err(fault) => return Err(LogError::at(&path)(fault)),
            }
        }
    }

    /// What the log starts with.
    #[must_use]
    pub fn preamble(&self) -> &Preamble {
        &self.preamble
    }

    /// The files that have been read to their end or left out.
    #[must_use]
    pub fn parts(&self) -> &[Part] {
        &self.parts
    }

    /// The next message or the end of the stream of `T`, passing over everything else; `None` at the end of the log.
    ///
    /// # Errors
    /// When something cannot be read; the next call goes on behind it.
    pub fn next_of<T: Logged>(&mut self) -> Result<Option<Entry<T>>, LogError> {
        self.next_on(T::SERVICE.name, decode::<T>)
    }

    /// The next picture or the end of the stream of `P`, as [`next_of`](Self::next_of).
    ///
    /// # Errors
    /// When something cannot be read; the next call goes on behind it.
    pub fn next_picture<P: Pictures>(&mut self) -> Result<Option<Entry<Image>>, LogError> {
        self.next_on(P::SERVICE.name, image::decode)
    }

    fn next_on<T>(&mut self, service: &str, decode: impl Fn(&[u8]) -> Result<(u64, T), DecodeError>) -> Result<Option<Entry<T>>, LogError> {
        while self.advance()? {
            let Some(message) = self.message() else { continue };
            let (topic, stamp_ns) = (message.channel.topic.as_str(), message.stamp_ns);
            let entry = if topic == service {
                decode(message.data).map(|(seq, payload)| Entry::Message { seq, stamp_ns, payload })
            } else if topic == END_TOPIC {
                match serde_json::from_slice::<End>(message.data) {
                    Ok(end) if end.service == service => Ok(Entry::End { seq: end.seq, stamp_ns }),
                    Ok(_) => continue,
                    Err(error) => Err(error.into()),
                }
            } else {
                continue;
            };
            return entry.map(Some).map_err(|source| self.fault(source));
        }
        Ok(None)
    }

    /// Bytes that have been read, and bytes of all files.
    #[must_use]
    pub fn position(&self) -> (u64, u64) {
        let closed: u64 = self.parts.iter().map(|part| part.bytes).sum();
        let (read, bytes) = self.current.as_ref().map_or((0, 0), |(_, bytes, reader)| (reader.offset(), *bytes));
        (closed + read, closed + bytes + self.waiting_bytes)
    }

    /// Goes on to the next message of any topic; false at the end of the log.
    ///
    /// # Errors
    /// When something cannot be read; the next call goes on behind it.
    pub fn advance(&mut self) -> Result<bool, LogError> {
        while self.current.is_some() || self.open_next()? {
            let Some((path, _, reader)) = &mut self.current else { continue };
            let path = path.clone();
            if !reader.advance().map_err(LogError::at(&path))? {
                self.close()?;
            } else if !self.is_repeated() {
                return Ok(true);
            }
        }
        Ok(false)
    }

    /// The message that was last gone on to.
    #[must_use]
    pub fn message(&self) -> Option<RawMessage<'_>> {
        self.current.as_ref().and_then(|(_, _, reader)| reader.message())
    }

    /// Opens the next part of this run; false when there is none.
    fn open_next(&mut self) -> Result<bool, LogError> {
        while let Some(path) = self.waiting.pop_front() {
            let (bytes, file) = open(&path)?;
            self.waiting_bytes = self.waiting_bytes.saturating_sub(bytes);
            let outcome = match read_part(&path, file) {
                Ok(reader) if reader.preamble().run == self.preamble.run => {
                    self.current = Some((path, bytes, reader));
                    return Ok(true);
                }
                Ok(reader) => Outcome::OtherRun(reader.preamble().run),
                Err(Fault::CutAtStart { .. }) => Outcome::Empty,
                Err(fault) => return Err(LogError::at(&path)(fault)),
            };
            self.parts.push(Part { path, bytes, outcome });
        }
        Ok(false)
    }

    /// Leaves the current file.
    fn close(&mut self) -> Result<(), LogError> {
        let Some((path, bytes, reader)) = self.current.take() else { return Ok(()) };
        let ending = reader.ending().cloned().unwrap_or(Ending::Complete);
        self.parts.push(Part { path: path.clone(), bytes, outcome: Outcome::Read(ending.clone()) });
        match ending {
            Ending::Damaged(damage) => Err(LogError::at(&path)(damage)),
            Ending::Complete | Ending::Cut { .. } => Ok(()),
        }
    }

    /// Whether the message was in the log before; takes note of it.
    fn is_repeated(&mut self) -> bool {
        let Some(message) = self.current.as_ref().and_then(|(_, _, reader)| reader.message()) else { return false };
        if !is_sequenced(&message.channel.topic) {
            return false;
        }
        match self.last.get_mut(&message.channel.topic) {
            // The low 32 bits of two numbers that are less than 2³¹ apart.
            Some(last) if (message.sequence.wrapping_sub(*last) as i32) <= 0 => true,
            Some(last) => {
                *last = message.sequence;
                false
            }
            None => {
                self.last.insert(message.channel.topic.clone(), message.sequence);
                false
            }
        }
    }

    fn fault(&self, source: DecodeError) -> LogError {
        let path = self.current.as_ref().map(|(path, _, _)| path.clone()).unwrap_or_default();
        let (offset, topic, sequence) = match self.message() {
            Some(message) => (message.offset, message.channel.topic.clone(), message.sequence),
            None => (0, String::new(), 0),
        };
        LogError::at(&path)(Fault::Message { offset, topic, sequence, source })
    }
}

/// Whether the messages of a topic are one numbered stream.
fn is_sequenced(topic: &str) -> bool {
    topic == PoseView::TOPIC || Service::named(topic).is_some_and(|service| service.sequenced)
}

fn decode<T: Logged>(data: &[u8]) -> Result<(u64, T), DecodeError> {
    let (seq, payload) = T::decode(data)?;
    payload.validate()?;
    Ok((seq, payload))
}

/// Reads a file from its start. One without a preamble there may have it elsewhere.
fn read_part(path: &Path, file: File) -> Result<PartReader<File>, Fault> {
    match PartReader::new(file) {
        Err(fault @ Fault::Damaged(_)) => match find_preamble(File::open(path)?) {
            Ok(Some(preamble)) => Ok(PartReader::with_preamble(File::open(path)?, preamble)),
            Err(foreign @ Fault::Foreign { .. }) => Err(foreign),
            Ok(None) | Err(_) => Err(fault),
        },
        read => read,
    }
}

fn open(path: &Path) -> Result<(u64, File), LogError> {
    let file = File::open(path).map_err(LogError::at(path))?;
    let bytes = file.metadata().map_err(LogError::at(path))?.len();
    Ok((bytes, file))
}
