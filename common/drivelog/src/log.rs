//! A log of one or more files, read as one.

use std::collections::VecDeque;
use std::fs::File;
use std::path::{Path, PathBuf};

use messages::{Pictures, Service};

use crate::damage::{Fault, LogError};
use crate::decode_error::DecodeError;
use crate::ending::Ending;
use crate::gaps::Gaps;
use crate::image::Image;
use crate::logged::Logged;
use crate::message_reader::RawMessage;
use crate::numbers::Numbers;
use crate::part::PartReader;
use crate::parts::{following_parts, is_later_part};
use crate::preamble::Preamble;
use crate::span::{Span, Timing};
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

/// What reading one message has found for one stream.
#[derive(Debug, Clone, PartialEq)]
pub enum Step<T> {
    /// A message or the end of the stream.
    Entry(Entry<T>),
    /// A message of another stream.
    Other,
    /// The end of the log.
    AtEnd,
}

/// A file of a log and the outcome of reading it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Part {
    /// The file.
    pub path: PathBuf,
    /// Its size.
    pub bytes: u64,
    /// The outcome of reading it.
    pub outcome: Outcome,
}

/// The outcome of reading a file of a log.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Outcome {
    /// It was read up to this end.
    Read(Ending),
    /// It ends before its first message.
    Empty,
    /// It is left out: it belongs to another run.
    OtherRun(u64),
}

/// Reads a log in the order in which it was written, with the parts that follow its first file.
pub struct Log {
    preamble: Preamble,
    current: Option<Current>,
    waiting: VecDeque<(u32, PathBuf)>,
    /// Size of the files that wait, bytes.
    waiting_bytes: u64,
    parts: Vec<Part>,
    numbers: Numbers,
    missing_parts: Vec<(u32, u32)>,
    /// Parts up to this number may have been removed on purpose.
    removed: u32,
    /// Number of the part that was opened last.
    number: u32,
    /// The log was opened by its first file: every part is expected.
    expects_parts: bool,
    /// The part that was read last says that another one follows.
    continues: bool,
    /// What of the streams is found.
    span: Span,
    /// Log time of the first message.
    first_ns: Option<u64>,
    /// A message of the span was found.
    has_begun: bool,
    /// Messages before the span were passed over unread: their numbers are not missing.
    has_skipped: bool,
}

/// The file that is being read.
struct Current {
    path: PathBuf,
    bytes: u64,
    reader: PartReader<File>,
}

impl Log {
    /// Opens a log by its first file, which may be missing if others follow. A file with the name of a later part is read by itself.
    ///
    /// # Errors
    /// When the file cannot be read, is no log, or is cut before its first message and nothing follows it.
    pub fn open(path: &Path) -> Result<Self, LogError> {
        let expects_parts = !is_later_part(path);
        let mut waiting: VecDeque<(u32, PathBuf)> = following_parts(path).map_err(LogError::at(path))?.into();
        if waiting.is_empty() || path.exists() {
            waiting.push_front((1, path.to_owned()));
        }
        let (mut parts, mut missing_parts, mut last) = (Vec::new(), Vec::new(), 0);
        loop {
            let Some((mut number, path)) = waiting.pop_front() else {
                return Err(LogError::at(path)(Fault::CutAtStart { offset: 0 }));
            };
            add_range(&mut missing_parts, last, number);
            last = number;
            let (bytes, file) = open(&path)?;
            match PartReader::new(file) {
                Ok(reader) => {
                    if number == 1 && expects_parts {
                        number = reader.number().unwrap_or(1);
                        add_range(&mut missing_parts, 0, number);
                    }
                    let preamble = reader.preamble().clone();
                    let removed = reader.removed().max(removed_at_last(&waiting, reader.preamble().run));
                    let waiting_bytes = waiting.iter().filter_map(|(_, path)| path.metadata().ok()).map(|file| file.len()).sum();
                    let current = Some(Current { path, bytes, reader });
                    return Ok(Self {
                        preamble,
                        current,
                        waiting,
                        waiting_bytes,
                        parts,
                        numbers: Numbers::default(),
                        missing_parts,
                        removed,
                        number,
                        expects_parts,
                        continues: false,
                        span: Span::default(),
                        first_ns: None,
                        has_begun: false,
                        has_skipped: false,
                    });
                }
                Err(Fault::CutAtStart { .. }) if !waiting.is_empty() => parts.push(Part { path, bytes, outcome: Outcome::Empty }),
                Err(fault) => return Err(LogError::at(&path)(fault)),
            }
        }
    }

    /// The same log, of whose streams only the messages in a span are found. Parts and chunks before it are passed over unread where the
    /// log has an index.
    #[must_use]
    pub fn within(self, span: Span) -> Self {
        Self { span, ..self }
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

    /// What the log lacks, as far as it has been read.
    #[must_use]
    pub fn gaps(&self) -> Gaps {
        let not_on_purpose = self.missing_parts.iter().filter(|(_, last)| *last > self.removed);
        Gaps {
            parts: not_on_purpose.map(|(first, last)| ((*first).max(self.removed.saturating_add(1)), *last)).collect(),
            messages: self.numbers.missing().clone(),
            removed: self.removed,
        }
    }

    /// Parts up to this number may have been removed by the limits of the recorder.
    #[must_use]
    pub fn removed_parts(&self) -> u32 {
        self.removed
    }

    /// The next message or the end of the stream of `T`, passing over everything else; `None` at the end of the log.
    ///
    /// # Errors
    /// When something cannot be read; the next call continues behind it.
    pub fn next_of<T: Logged>(&mut self) -> Result<Option<Entry<T>>, LogError> {
        until_entry(|| self.step_of())
    }

    /// Reads one message, for the stream of `T`: [`next_of`](Self::next_of) may read the whole log.
    ///
    /// # Errors
    /// When something cannot be read; the next call continues behind it.
    pub fn step_of<T: Logged>(&mut self) -> Result<Step<T>, LogError> {
        self.step_on(T::SERVICE.name, decode::<T>)
    }

    /// The next picture or the end of the stream of `P`, as [`next_of`](Self::next_of).
    ///
    /// # Errors
    /// When something cannot be read; the next call continues behind it.
    pub fn next_picture<P: Pictures>(&mut self) -> Result<Option<Entry<Image>>, LogError> {
        until_entry(|| self.step_picture::<P>())
    }

    /// Reads one message, for the stream of `P`, as [`step_of`](Self::step_of).
    ///
    /// # Errors
    /// When something cannot be read; the next call continues behind it.
    pub fn step_picture<P: Pictures>(&mut self) -> Result<Step<Image>, LogError> {
        self.step_on(P::SERVICE.name, Image::decode)
    }

    fn step_on<T>(&mut self, service: &str, decode: impl Fn(&[u8]) -> Result<(u64, T), DecodeError>) -> Result<Step<T>, LogError> {
        if !self.advance()? {
            return Ok(Step::AtEnd);
        }
        match self.timing()? {
            Timing::Before => return Ok(Step::Other),
            Timing::Within => {}
            Timing::Behind => return Ok(Step::AtEnd),
        }
        let Some(message) = self.message() else { return Ok(Step::Other) };
        let (topic, stamp_ns) = (message.channel.topic.as_str(), message.stamp_ns);
        let entry = if topic == service {
            decode(message.data).map(|(seq, payload)| Entry::Message { seq, stamp_ns, payload })
        } else if topic == END_TOPIC {
            match serde_json::from_slice::<End>(message.data) {
                Ok(end) if end.service == service => Ok(Entry::End { seq: end.seq, stamp_ns }),
                Ok(_) => return Ok(Step::Other),
                Err(error) => Err(error.into()),
            }
        } else {
            return Ok(Step::Other);
        };
        entry.map(Step::Entry).map_err(|source| self.fault(source))
    }

    /// Where the current message lies. The first one of the log decides where the span begins.
    fn timing(&mut self) -> Result<Timing, LogError> {
        let Some(log_ns) = self.message().map(|message| message.log_ns) else { return Ok(Timing::Within) };
        let is_first = self.first_ns.is_none();
        let first_ns = *self.first_ns.get_or_insert(log_ns);
        let timing = self.span.timing(first_ns, log_ns);
        self.has_begun |= timing != Timing::Before;
        if is_first && timing == Timing::Before {
            self.skip()?;
        }
        Ok(timing)
    }

    /// Passes over what of the current part is before the span.
    fn skip(&mut self) -> Result<(), LogError> {
        let from_ns = self.first_ns.filter(|_| self.span.from_ns > 0).map(|first_ns| first_ns.saturating_add(self.span.from_ns));
        let Some(from_ns) = from_ns else { return Ok(()) };
        let Some(Current { path, reader, .. }) = &mut self.current else { return Ok(()) };
        if reader.skip_to(from_ns).map_err(LogError::at(path))? {
            self.has_skipped = true;
            // In the span, a later part begins with messages that an earlier one has, too.
            if !self.has_begun {
                self.numbers.forget();
            }
        }
        Ok(())
    }

    /// Bytes that have been read, and bytes of all files.
    #[must_use]
    pub fn position(&self) -> (u64, u64) {
        let closed: u64 = self.parts.iter().map(|part| part.bytes).sum();
        let (read, bytes) = self.current.as_ref().map_or((0, 0), |current| (current.reader.offset(), current.bytes));
        (closed + read, closed + bytes + self.waiting_bytes)
    }

    /// Advances to the next message of any topic; false at the end of the log.
    ///
    /// # Errors
    /// When something cannot be read; the next call continues behind it.
    pub fn advance(&mut self) -> Result<bool, LogError> {
        while self.current.is_some() || self.open_next()? {
            let Some(Current { path, reader, .. }) = &mut self.current else { continue };
            let path = path.clone();
            if !reader.advance().map_err(LogError::at(&path))? {
                self.close()?;
            } else if self.is_new() {
                return Ok(true);
            }
        }
        Ok(false)
    }

    /// The current message.
    #[must_use]
    pub fn message(&self) -> Option<RawMessage<'_>> {
        self.current.as_ref().and_then(|current| current.reader.message())
    }

    /// Opens the next part of this run; false when there is none.
    fn open_next(&mut self) -> Result<bool, LogError> {
        while let Some((number, path)) = self.waiting.pop_front() {
            let before = self.number;
            add_range(&mut self.missing_parts, before, number);
            self.number = number;
            let (bytes, file) = open(&path)?;
            self.waiting_bytes = self.waiting_bytes.saturating_sub(bytes);
            let outcome = match PartReader::new(file) {
                Ok(reader) if reader.preamble().run == self.preamble.run => {
                    if number - before > 1 && number <= self.removed.saturating_add(1) {
                        self.numbers.forget();
                    }
                    self.current = Some(Current { path, bytes, reader });
                    self.skip()?;
                    return Ok(true);
                }
                Ok(reader) => Outcome::OtherRun(reader.preamble().run),
                Err(Fault::CutAtStart { .. }) => Outcome::Empty,
                Err(fault) => return Err(LogError::at(&path)(fault)),
            };
            self.parts.push(Part { path, bytes, outcome });
        }
        if std::mem::take(&mut self.continues) {
            add_range(&mut self.missing_parts, self.number, self.number.saturating_add(2));
        }
        Ok(false)
    }

    /// Leaves the current file.
    fn close(&mut self) -> Result<(), LogError> {
        let Some(Current { path, bytes, reader }) = self.current.take() else { return Ok(()) };
        self.continues = reader.continues() && self.expects_parts;
        let ending = reader.ending().cloned().unwrap_or(Ending::Complete);
        self.parts.push(Part { path: path.clone(), bytes, outcome: Outcome::Read(ending.clone()) });
        match ending {
            Ending::Damaged(damage) => Err(LogError::at(&path)(damage)),
            Ending::Complete | Ending::Cut { .. } => Ok(()),
        }
    }

    /// Takes note of the number of the current message; false if the log has had it before.
    fn is_new(&mut self) -> bool {
        let Self { current, numbers, number, removed, has_skipped, .. } = self;
        let Some(message) = current.as_ref().and_then(|current| current.reader.message()) else { return true };
        let topic = message.channel.topic.as_str();
        !is_sequenced(topic) || numbers.take(topic, message.sequence, *has_skipped || *number <= removed.saturating_add(1))
    }

    /// The error of the current message.
    pub(crate) fn fault(&self, source: DecodeError) -> LogError {
        let path = self.current.as_ref().map(|current| current.path.clone()).unwrap_or_default();
        let (offset, topic, sequence) = match self.message() {
            Some(message) => (message.offset, message.channel.topic.clone(), message.sequence),
            None => (0, String::new(), 0),
        };
        LogError::at(&path)(Fault::Message { offset, topic, sequence, source })
    }
}

/// The next entry of a stream; `None` at the end of the log.
fn until_entry<T>(mut step: impl FnMut() -> Result<Step<T>, LogError>) -> Result<Option<Entry<T>>, LogError> {
    loop {
        match step()? {
            Step::Entry(entry) => return Ok(Some(entry)),
            Step::Other => {}
            Step::AtEnd => return Ok(None),
        }
    }
}

/// Parts up to this number may have been removed on purpose, as the last readable part of a run says, which knows of all removals.
fn removed_at_last(waiting: &VecDeque<(u32, PathBuf)>, run: u64) -> u32 {
    let reader = |path: &PathBuf| PartReader::new(File::open(path).ok()?).ok();
    let mut later = waiting.iter().rev().filter_map(|(_, path)| reader(path));
    later.find(|reader| reader.preamble().run == run).map_or(0, |reader| reader.removed())
}

/// Adds the numbers between these two.
fn add_range(ranges: &mut Vec<(u32, u32)>, before: u32, behind: u32) {
    if behind.saturating_sub(before) > 1 {
        ranges.push((before + 1, behind - 1));
    }
}

/// Whether the messages of a topic are one numbered stream.
pub(crate) fn is_sequenced(topic: &str) -> bool {
    topic == PoseView::TOPIC || Service::named(topic).is_some_and(|service| service.sequenced)
}

fn decode<T: Logged>(data: &[u8]) -> Result<(u64, T), DecodeError> {
    let (seq, payload) = T::decode(data)?;
    payload.validate()?;
    if T::SERVICE.sequenced && seq == 0 {
        return Err(DecodeError::Unnumbered(""));
    }
    Ok((seq, payload))
}

fn open(path: &Path) -> Result<(u64, File), LogError> {
    let file = File::open(path).map_err(LogError::at(path))?;
    let bytes = file.metadata().map_err(LogError::at(path))?.len();
    Ok((bytes, file))
}
