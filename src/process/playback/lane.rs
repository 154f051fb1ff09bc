//! One stream on its way from the log to the bus.

use ::playback::{Answers, Head, Window};
use bus::{BusError, FrameWriter, Writer};
use drivelog::{Entry, Gaps, Image, Log, LogError, Logged};
use messages::Pictures;
use runtime::StepError;

/// Messages of the log that can be sent, one after the other.
pub(super) trait Source {
    /// Number and stamp of the message that comes next; `None` at the end of the stream.
    fn peek(&mut self) -> Result<Option<(u64, u64)>, LogError>;

    /// Sends that message, unless it is only to be passed over.
    fn pass(&mut self, send: bool) -> Result<(), BusError>;

    /// Says that the stream ends.
    fn end(&mut self, seq: u64, stamp_ns: u64) -> Result<(), BusError>;

    /// Bytes of the log that have been read, and bytes of all its files.
    fn position(&self) -> (u64, u64);

    /// What the log lacks, as far as it has been read.
    fn gaps(&self) -> Gaps;
}

/// A reading of the log that stops at each entry of one stream.
pub(super) struct Cursor<T> {
    log: Log,
    next: Option<Entry<T>>,
}

impl<T> Cursor<T> {
    pub(super) fn new(log: Log) -> Self {
        Self { log, next: None }
    }

    fn peek(&mut self, read: impl Fn(&mut Log) -> Result<Option<Entry<T>>, LogError>) -> Result<Option<(u64, u64)>, LogError> {
        loop {
            match &self.next {
                Some(Entry::Message { seq, stamp_ns, .. }) => return Ok(Some((*seq, *stamp_ns))),
                // A run that was stopped and started again goes on behind the end.
                Some(Entry::End { .. }) | None => self.next = read(&mut self.log)?,
            }
            if self.next.is_none() {
                return Ok(None);
            }
        }
    }
}

/// Messages of a service.
pub(super) struct Messages<T: Logged> {
    pub(super) cursor: Cursor<T>,
    pub(super) writer: Writer<T>,
}

impl<T: Logged> Source for Messages<T> {
    fn peek(&mut self) -> Result<Option<(u64, u64)>, LogError> {
        self.cursor.peek(Log::next_of::<T>)
    }

    fn pass(&mut self, send: bool) -> Result<(), BusError> {
        match self.cursor.next.take() {
            Some(Entry::Message { seq, stamp_ns, payload }) if send => self.writer.send(seq, stamp_ns, &payload),
            _ => Ok(()),
        }
    }

    fn end(&mut self, seq: u64, stamp_ns: u64) -> Result<(), BusError> {
        self.writer.end(seq, stamp_ns)
    }

    fn position(&self) -> (u64, u64) {
        self.cursor.log.position()
    }

    fn gaps(&self) -> Gaps {
        self.cursor.log.gaps()
    }
}

/// Pictures of a service.
pub(super) struct Images<P: Pictures> {
    pub(super) cursor: Cursor<Image>,
    pub(super) writer: FrameWriter<P>,
}

impl<P: Pictures> Source for Images<P> {
    fn peek(&mut self) -> Result<Option<(u64, u64)>, LogError> {
        self.cursor.peek(Log::next_picture::<P>)
    }

    fn pass(&mut self, send: bool) -> Result<(), BusError> {
        match self.cursor.next.take() {
            Some(Entry::Message { seq, stamp_ns, payload }) if send => self.writer.send(seq, stamp_ns, payload.layout, &payload.bytes),
            _ => Ok(()),
        }
    }

    fn end(&mut self, seq: u64, stamp_ns: u64) -> Result<(), BusError> {
        self.writer.end(seq, stamp_ns)
    }

    fn position(&self) -> (u64, u64) {
        self.cursor.log.position()
    }

    fn gaps(&self) -> Gaps {
        self.cursor.log.gaps()
    }
}

/// A stream with those who consume it.
pub(super) struct Lane {
    pub(super) source: Box<dyn Source>,
    /// Its place among the streams of [`Resume`](::playback::Resume).
    pub(super) stream: usize,
    pub(super) service: &'static str,
    /// Nobody lacks this message or one before it.
    pub(super) begin_behind: u64,
    /// What a consumer has answered that has not said so.
    pub(super) assumed: u64,
    pub(super) answers: Answers,
    /// `None` live.
    pub(super) window: Option<Window>,
    /// Size of the window once every consumer has said how far it is.
    pub(super) size: u32,
    /// Number and stamp of the last message that was passed.
    pub(super) last: (u64, u64),
    pub(super) sent: u64,
    pub(super) ended: bool,
}

impl Lane {
    /// Takes account of what its consumers have answered.
    pub(super) fn heed_answers(&mut self) {
        let Some(window) = &mut self.window else { return };
        if !self.answers.lack_one() {
            window.resize(self.size);
        }
        // Without a consumer there is nobody to wait for.
        window.answered(self.answers.floor(self.assumed).unwrap_or(u64::MAX));
    }

    /// Whether its consumers have to answer before it may send.
    pub(super) fn is_held(&self) -> bool {
        !self.ended && self.window.as_ref().is_some_and(|window| !window.has_room())
    }

    /// Its next message; says its end when there is none.
    pub(super) fn head(&mut self) -> Result<Option<Head>, StepError> {
        if self.ended {
            return Ok(None);
        }
        match self.source.peek()? {
            Some((seq, stamp_ns)) => {
                // What is only passed over takes no room.
                let has_room = seq <= self.begin_behind || self.window.as_ref().is_none_or(Window::has_room);
                Ok(Some(Head { stamp_ns, has_room, last_ns: self.last.1 }))
            }
            None => {
                self.end()?;
                Ok(None)
            }
        }
    }

    /// Passes over its next message, which has this number and stamp.
    pub(super) fn pass_over(&mut self, seq: u64, stamp_ns: u64) -> Result<(), BusError> {
        self.last = (seq, stamp_ns);
        self.source.pass(false)
    }

    /// Sends its next message, which has this number and stamp.
    pub(super) fn send(&mut self, seq: u64, stamp_ns: u64) -> Result<(), BusError> {
        self.source.pass(true)?;
        if let Some(window) = &mut self.window {
            window.sent(seq);
        }
        self.last = (seq, stamp_ns);
        self.sent += 1;
        Ok(())
    }

    pub(super) fn end(&mut self) -> Result<(), BusError> {
        if !self.ended {
            self.source.end(self.last.0, self.last.1)?;
            self.ended = true;
        }
        Ok(())
    }
}
