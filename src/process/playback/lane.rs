//! One stream on its way from the log to the bus.

use ::playback::{Answers, Behind, Head, Window};
use bus::{BusError, FrameWriter, Writer};
use drivelog::{Entry, Gaps, Image, Log, LogError, Logged, Step};
use messages::Pictures;
use runtime::StepError;

/// Messages of the log that can be sent, one after the other.
pub(super) trait Source {
    /// Looks for the message that comes next until the round is over: a log may have no further one of this stream. False when it is not
    /// found yet.
    fn search(&mut self, round_is_over: &dyn Fn() -> bool) -> Result<bool, LogError>;

    /// Number and stamp of the message that was found; `None` at the end of the stream.
    fn peek(&self) -> Option<(u64, u64)>;

    /// Sends that message, or skips it.
    fn pass(&mut self, send: bool) -> Result<(), BusError>;

    /// Publishes the end of the stream.
    fn end(&mut self, seq: u64, stamp_ns: u64) -> Result<(), BusError>;

    /// Bytes of the log that have been read, and bytes of all its files.
    fn position(&self) -> (u64, u64);

    /// What the log lacks, as far as it has been read.
    fn gaps(&self) -> Gaps;
}

/// A reading of the log that stops at each message of one stream.
pub(super) struct Cursor<T> {
    log: Log,
    /// Number, stamp and payload.
    next: Option<(u64, u64, T)>,
    at_end: bool,
}

impl<T> Cursor<T> {
    pub(super) fn new(log: Log) -> Self {
        Self { log, next: None, at_end: false }
    }

    fn search(&mut self, round_is_over: &dyn Fn() -> bool, step: impl Fn(&mut Log) -> Result<Step<T>, LogError>) -> Result<bool, LogError> {
        while self.next.is_none() && !self.at_end {
            match step(&mut self.log)? {
                Step::Entry(Entry::Message { seq, stamp_ns, payload }) => self.next = Some((seq, stamp_ns, payload)),
                // A run that was stopped and resumed continues after the end.
                Step::Entry(Entry::End { .. }) | Step::Other if round_is_over() => return Ok(false),
                Step::Entry(Entry::End { .. }) | Step::Other => {}
                Step::AtEnd => self.at_end = true,
            }
        }
        Ok(true)
    }

    fn peek(&self) -> Option<(u64, u64)> {
        self.next.as_ref().map(|(seq, stamp_ns, _)| (*seq, *stamp_ns))
    }
}

/// Messages of a service.
pub(super) struct Messages<T: Logged> {
    pub(super) cursor: Cursor<T>,
    pub(super) writer: Writer<T>,
}

impl<T: Logged> Source for Messages<T> {
    fn search(&mut self, round_is_over: &dyn Fn() -> bool) -> Result<bool, LogError> {
        self.cursor.search(round_is_over, Log::step_of::<T>)
    }

    fn peek(&self) -> Option<(u64, u64)> {
        self.cursor.peek()
    }

    fn pass(&mut self, send: bool) -> Result<(), BusError> {
        match self.cursor.next.take() {
            Some((seq, stamp_ns, payload)) if send => self.writer.send(seq, stamp_ns, &payload),
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
    fn search(&mut self, round_is_over: &dyn Fn() -> bool) -> Result<bool, LogError> {
        self.cursor.search(round_is_over, Log::step_picture::<P>)
    }

    fn peek(&self) -> Option<(u64, u64)> {
        self.cursor.peek()
    }

    fn pass(&mut self, send: bool) -> Result<(), BusError> {
        match self.cursor.next.take() {
            Some((seq, stamp_ns, payload)) if send => self.writer.send(seq, stamp_ns, payload.layout, &payload.bytes),
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

/// Processes that lockstep does not leave farther behind than a window.
pub(super) struct Limit {
    pub(super) answers: Answers,
    /// `None` live.
    window: Option<Window>,
    /// Size of the window once each of them has reported its progress.
    size: u32,
}

impl Limit {
    /// A window of `size` messages, or of at most `lead` until each process has reported.
    pub(super) fn new(answers: Answers, size: u32, lead: Option<u32>, lockstep: bool) -> Self {
        let first = lead.map_or(size, |lead| size.min(lead));
        Self { answers, window: lockstep.then(|| Window::new(first)), size }
    }

    fn heed_answers(&mut self, assumed: u64) {
        let Some(window) = &mut self.window else { return };
        if !self.answers.lack_one() {
            window.resize(self.size);
        }
        // Without a process there is nothing to wait for.
        window.answered(self.answers.floor(assumed).unwrap_or(u64::MAX));
    }

    fn has_room(&self) -> bool {
        self.window.as_ref().is_none_or(Window::has_room)
    }
}

/// A stream with its consumers.
pub(super) struct Lane {
    pub(super) source: Box<dyn Source>,
    /// Its place among the streams of [`Resume`](::playback::Resume).
    pub(super) stream: usize,
    pub(super) service: &'static str,
    /// No consumer lacks this message or an earlier one.
    pub(super) begin_behind: u64,
    /// What a consumer without a report has answered.
    pub(super) assumed: u64,
    pub(super) limits: Vec<Limit>,
    /// Number and stamp of the last message that was passed.
    pub(super) last: (u64, u64),
    pub(super) sent: u64,
    pub(super) ended: bool,
}

impl Lane {
    /// Takes account of what its consumers have answered.
    pub(super) fn heed_answers(&mut self) {
        self.limits.iter_mut().for_each(|limit| limit.heed_answers(self.assumed));
    }

    /// The reports on its messages.
    pub(super) fn answers(&mut self) -> impl Iterator<Item = &mut Answers> {
        self.limits.iter_mut().map(|limit| &mut limit.answers)
    }

    /// Whether no consumer can need it again.
    pub(super) fn is_complete(&self) -> bool {
        self.limits.iter().all(|limit| limit.answers.are_complete(self.last.0))
    }

    /// The consumer that it waits for.
    pub(super) fn behind(&self) -> Option<Behind<'_>> {
        let full = self.limits.iter().filter(|limit| !self.ended && !limit.has_room());
        full.filter_map(|limit| limit.answers.behind(self.last.0)).min()
    }

    fn has_room(&self) -> bool {
        self.limits.iter().all(Limit::has_room)
    }

    /// Looks for its next message until the round is over; false when it is not found yet.
    pub(super) fn search(&mut self, round_is_over: &dyn Fn() -> bool) -> Result<bool, StepError> {
        Ok(self.ended || self.source.search(round_is_over)?)
    }

    /// Its next message; publishes the end when there is none.
    pub(super) fn head(&mut self) -> Result<Option<Head>, StepError> {
        if self.ended {
            return Ok(None);
        }
        match self.source.peek() {
            Some((seq, stamp_ns)) => {
                // A message that is skipped takes no room.
                let has_room = seq <= self.begin_behind || self.has_room();
                Ok(Some(Head { stamp_ns, has_room, last_ns: self.last.1 }))
            }
            None => {
                self.end()?;
                Ok(None)
            }
        }
    }

    /// Skips its next message, which has this number and stamp.
    pub(super) fn pass_over(&mut self, seq: u64, stamp_ns: u64) -> Result<(), BusError> {
        self.last = (seq, stamp_ns);
        self.source.pass(false)
    }

    /// Sends its next message, which has this number and stamp.
    pub(super) fn send(&mut self, seq: u64, stamp_ns: u64) -> Result<(), BusError> {
        self.source.pass(true)?;
        self.limits.iter_mut().filter_map(|limit| limit.window.as_mut()).for_each(|window| window.sent(seq));
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

#[cfg(test)]
mod tests {
    use super::*;
    use drivelog::{Preamble, Recording};
    use messages::{CameraFrame, SonarScan};

    #[test]
    fn a_search_through_a_log_without_pictures_ends_with_each_round() {
        const SCANS: u64 = 100;
        let preamble = Preamble { run: 1, robot: "pioneer-1".into(), sonars: Vec::new(), origin: "a test".into(), settings: String::new() };
        let mut recording = Recording::new(&preamble).unwrap();
        (1..=SCANS).for_each(|seq| recording.scan(seq, seq, &SonarScan::default()).unwrap());
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("drive.mcap");
        std::fs::write(&path, recording.finish().unwrap()).unwrap();
        let mut cursor = Cursor::<Image>::new(Log::open(&path).unwrap());
        let mut rounds = 1;
        while !cursor.search(&|| true, Log::step_picture::<CameraFrame>).unwrap() {
            rounds += 1;
        }
        // Each scan is two messages: its pose is one, too.
        assert_eq!((rounds, cursor.peek()), (2 * SCANS + 1, None));
    }
}
