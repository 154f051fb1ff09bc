//! What a reader knows of its stream, and what it therefore hands out.

use std::cell::RefCell;
use std::fmt::Arguments;
use std::rc::Rc;
use std::time::Instant;

use bytemuck::Pod;
use messages::{Header, InputCounters, Invalid, Kind, Service, Text};

use crate::clock::DeploymentClock;
use crate::episode::Episode;
use crate::latency::Latencies;

/// Messages after which latencies are made out anew.
const LATENCIES_EVERY: u64 = 16;

/// What a reader hands out.
///
/// ```
/// use stillmap_bus::Received;
///
/// let received: Received<&str> = Received::End { seq: 12 };
/// match received {
///     Received::Message(message) => println!("{message}"),
///     Received::End { seq } => assert_eq!(seq, 12, "no message follows"),
/// }
/// ```
pub enum Received<M> {
    /// A message.
    Message(M),
    /// The stream ends: nothing comes after `seq`.
    End {
        /// Last number of the stream.
        seq: u64,
    },
}

/// What becomes of a message that has arrived.
pub(crate) enum Admission {
    /// It is handed out; so many are missing before it.
    Message { lost_before: u64 },
    /// It says that the stream ends after `seq`, for the first time.
    End { seq: u64 },
    /// It is intact, but its values are invalid.
    Refused { problem: String },
    /// It is not handed out: of another run, damaged, or had before.
    Dropped,
}

/// Why messages are refused. Each reason is an episode of its own in the log.
#[derive(Debug, Clone, Copy)]
enum Reason {
    OtherRun,
    Checksum,
    OutOfRange,
    Restarted,
}

/// The refused messages of a stream in the log: a line when they begin, and one with their number when they are over.
struct Refusals {
    service: &'static str,
    episodes: [(Reason, Episode); 4],
}

impl Refusals {
    fn new(service: &'static str) -> Self {
        let reasons = [Reason::OtherRun, Reason::Checksum, Reason::OutOfRange, Reason::Restarted];
        Self { service, episodes: reasons.map(|reason| (reason, Episode::default())) }
    }

    fn note(&mut self, reason: Reason, seq: u64, problem: Arguments<'_>) {
        if self.episodes[reason as usize].1.occurred(Instant::now()) {
            tracing::warn!("refused message {seq} of {}: {problem}", self.service);
        }
    }

    /// Reports the episodes that are over; with `is_last`, all of them.
    fn report(&mut self, is_last: bool) {
        for (reason, episode) in self.episodes.iter_mut().filter(|(_, episode)| episode.is_open()) {
            let count = if is_last { episode.close() } else { episode.over(Instant::now()) };
            if let Some(count) = count {
                let what = match reason {
                    Reason::OtherRun => "of another run",
                    Reason::Checksum => "with a wrong checksum",
                    Reason::OutOfRange => "out of order or out of range",
                    Reason::Restarted => "of a sender that has restarted its numbers",
                };
                tracing::info!("refused {count} messages of {} {what}; no more of them arrive", self.service);
            }
        }
    }
}

impl Drop for Refusals {
    fn drop(&mut self) {
        self.report(true);
    }
}

/// The reader's side of one service: counts, order and checks.
pub(crate) struct Stream {
    service: &'static Service,
    run: u64,
    /// None for observers, on which no process waits.
    clock: Option<DeploymentClock>,
    latencies: Box<Latencies>,
    account: Rc<RefCell<Account>>,
    refusals: Refusals,
    last_stamp_ns: u64,
    skips: Skips,
    /// What was sent before the first message that comes is not missed.
    joins: bool,
    ended: bool,
}

/// Messages that the sender has left out since the last one that was handed out.
#[derive(Default)]
struct Skips {
    count: u64,
    last: u64,
}

impl Skips {
    /// Takes note that the sender has left out this message; only once when it says so again.
    fn note(&mut self, seq: u64) {
        self.count += u64::from(seq > self.last);
        self.last = self.last.max(seq);
    }

    /// How many of `missing` messages were lost, where the others were left out.
    fn lost_of(&mut self, missing: u64) -> u64 {
        missing.saturating_sub(std::mem::take(&mut self.count))
    }
}

/// How far a reader is, for the shell of its process.
pub(crate) struct Account {
    pub(crate) counters: InputCounters,
    /// The last message that was handed out.
    handed_out: u64,
    /// The last message that came, or is known not to come: no earlier one is handed out any more.
    passed: u64,
}

impl Account {
    /// How far a stream is answered by a process that has answered what was handed out up to `seq`: behind all of that, what was
    /// refused counts as answered, too.
    pub(crate) fn answered(&self, seq: u64) -> u64 {
        if seq >= self.handed_out { seq.max(self.passed) } else { seq }
    }

    fn pass(&mut self, seq: u64) {
        self.passed = self.passed.max(seq);
    }
}

impl Stream {
    pub(crate) fn new(service: &'static Service, run: u64, clock: Option<DeploymentClock>) -> Self {
        let counters = InputCounters { service: Text::new(service.name), ..InputCounters::default() };
        Self {
            service,
            run,
            clock,
            latencies: Box::new(Latencies::new()),
            account: Rc::new(RefCell::new(Account { counters, handed_out: 0, passed: 0 })),
            refusals: Refusals::new(service.name),
            last_stamp_ns: 0,
            skips: Skips::default(),
            joins: false,
            ended: false,
        }
    }

    pub(crate) fn account(&self) -> Rc<RefCell<Account>> {
        self.account.clone()
    }

    pub(crate) fn skip_to(&mut self, seq: u64, stamp_ns: u64) {
        let mut account = self.account.borrow_mut();
        account.handed_out = account.handed_out.max(seq);
        account.pass(seq);
        self.last_stamp_ns = self.last_stamp_ns.max(stamp_ns);
    }

    pub(crate) fn join(&mut self) {
        self.joins = true;
    }

    pub(crate) fn passed(&self) -> u64 {
        self.account.borrow().passed
    }

    pub(crate) fn ended(&self) -> bool {
        self.ended
    }

    /// Decides on a message, whose `checksum` is that of [`checksum`], and counts it. `validate` checks the values of the payload.
    pub(crate) fn admit(
        &mut self,
        header: &Header,
        checksum: impl FnOnce() -> u32,
        validate: impl FnOnce() -> Result<(), Invalid>,
    ) -> Admission {
        let service = self.service;
        let mut account = self.account.borrow_mut();
        let account = &mut *account;
        if header.run != self.run {
            account.counters.refused += 1;
            self.refusals.note(Reason::OtherRun, header.seq, format_args!("it is of run {:016x}, expected {:016x}", header.run, self.run));
            return Admission::Dropped;
        }
        let found = checksum();
        if header.crc32 != found {
            account.counters.refused += 1;
            // Its number may be damaged, too; one that is next to come is believed, and no other.
            if service.sequenced && header.seq.saturating_sub(account.passed) <= service.qos.history as u64 {
                account.pass(header.seq);
            }
            let problem = format_args!("its checksum is {found:08x}, expected {:08x}", header.crc32);
            self.refusals.note(Reason::Checksum, header.seq, problem);
            return Admission::Dropped;
        }
        let kind = Kind::from_number(header.kind);
        let problem =
            if service.sequenced && kind == Some(Kind::Data) && header.seq > account.handed_out && header.stamp_ns < self.last_stamp_ns {
                Some(format!("its stamp {} ns is before {} ns", header.stamp_ns, self.last_stamp_ns))
            } else {
                match kind {
                    None => Some(format!("its kind is {}, expected 0 to 3", header.kind)),
                    Some(Kind::Data) => validate().err().map(|invalid| invalid.to_string()),
                    Some(Kind::End | Kind::Gap | Kind::Skipped) => None,
                }
            };
        if let Some(problem) = problem {
            account.counters.refused += 1;
            account.pass(header.seq);
            self.refusals.note(Reason::OutOfRange, header.seq, format_args!("{problem}"));
            return Admission::Refused { problem };
        }
        self.refusals.report(false);
        account.pass(header.seq);
        if kind == Some(Kind::Gap) {
            return Admission::Dropped;
        }
        if kind == Some(Kind::Skipped) {
            if header.seq > account.handed_out {
                self.skips.note(header.seq);
            }
            return Admission::Dropped;
        }
        if kind == Some(Kind::End) {
            if self.ended {
                return Admission::Dropped;
            }
            self.ended = true;
            account.counters.lost += self.skips.lost_of(header.seq.saturating_sub(account.handed_out));
            account.handed_out = account.handed_out.max(header.seq);
            return Admission::End { seq: header.seq };
        }
        let mut lost_before = 0;
        if service.sequenced {
            if header.seq <= account.handed_out {
                // A republished message has its old stamp. With a newer one, its sender has restarted its numbering.
                if self.last_stamp_ns > 0 && header.stamp_ns > self.last_stamp_ns {
                    account.counters.refused += 1;
                    let known = account.handed_out;
                    let problem = format_args!("numbers up to {known} are received, and it is newer: its sender has restarted its numbers");
                    self.refusals.note(Reason::Restarted, header.seq, problem);
                } else {
                    account.counters.repeated += 1;
                }
                return Admission::Dropped;
            }
            let is_first = account.handed_out == 0;
            let lost = self.skips.lost_of(header.seq - account.handed_out - 1);
            lost_before = if self.joins && is_first { 0 } else { lost };
            account.handed_out = header.seq;
            self.last_stamp_ns = header.stamp_ns;
        }
        let counters = &mut account.counters;
        if let Some(clock) = self.clock {
            self.latencies.take(clock.since(header.stamp_ns));
            // Often enough for people, too seldom to cost anything.
            if counters.received.is_multiple_of(LATENCIES_EVERY) {
                counters.latency_median_us = self.latencies.within_us(0.5);
                counters.latency_p99_us = self.latencies.within_us(0.99);
            }
        }
        counters.received += 1;
        counters.lost += lost_before;
        counters.last_seq = header.seq;
        Admission::Message { lost_before }
    }
}

/// CRC-32 of a message; in `header` the place of the checksum is 0.
pub(crate) fn checksum(header: &impl Pod, payload: &[u8]) -> u32 {
    let mut hasher = crc32fast::Hasher::new();
    hasher.update(bytemuck::bytes_of(header));
    hasher.update(payload);
    hasher.finalize()
}

#[cfg(test)]
mod tests {
    use super::*;
    use messages::{Payload, SonarScan};

    const RUN: u64 = 7;
    const CHECKSUM: u32 = 5;

    fn stream() -> Stream {
        Stream::new(&SonarScan::SERVICE, RUN, None)
    }

    fn header(kind: Kind, seq: u64, stamp_ns: u64) -> Header {
        Header { run: RUN, seq, stamp_ns, kind: kind as u32, crc32: CHECKSUM }
    }

    fn is_handed_out(stream: &mut Stream, header: &Header) -> bool {
        matches!(stream.admit(header, || CHECKSUM, || Ok(())), Admission::Message { .. })
    }

    fn answered(stream: &Stream, seq: u64) -> u64 {
        stream.account().borrow().answered(seq)
    }

    #[test]
    fn answers_to_messages_cover_the_refused_ones_behind_them() {
        let mut stream = stream();
        assert!(is_handed_out(&mut stream, &header(Kind::Data, 1, 100)));
        assert!(!is_handed_out(&mut stream, &header(Kind::Data, 2, 50)), "its clock was set back");
        assert_eq!((answered(&stream, 0), answered(&stream, 1)), (0, 2));
        let invalid = |stream: &mut Stream, seq| {
            stream.admit(
                &header(Kind::Data, seq, 100),
                || CHECKSUM,
                || Err(Invalid { field: "count", found: 17.0, expected: "at most 16" }),
            )
        };
        assert!(matches!(invalid(&mut stream, 3), Admission::Refused { .. }));
        assert!(!is_handed_out(&mut stream, &header(Kind::Gap, 4, 0)));
        assert_eq!((answered(&stream, 1), stream.passed()), (4, 4));
        assert!(is_handed_out(&mut stream, &header(Kind::Data, 6, 200)));
        assert_eq!((answered(&stream, 1), answered(&stream, 6)), (1, 6));
        assert_eq!((stream.account().borrow().counters.lost, stream.account().borrow().counters.refused), (4, 2));
    }

    #[test]
    fn the_number_of_a_damaged_message_counts_if_it_is_near() {
        let mut stream = stream();
        let mut damaged = |seq| {
            assert!(matches!(stream.admit(&header(Kind::Data, seq, 0), || CHECKSUM + 1, || Ok(())), Admission::Dropped));
            stream.passed()
        };
        let history = SonarScan::SERVICE.qos.history as u64;
        assert_eq!([1, 3 + history, u64::MAX, 2, 1, 2 + history].map(&mut damaged), [1, 1, 1, 2, 2, 2 + history]);
        let other_run = Header { run: RUN + 1, ..header(Kind::Data, 3 + history, 0) };
        assert!(!is_handed_out(&mut stream, &other_run));
        assert_eq!(stream.passed(), 2 + history);
    }

    #[test]
    fn the_end_comes_whatever_its_clock_says() {
        let mut stream = stream();
        assert!(is_handed_out(&mut stream, &header(Kind::Data, 1, 1_000)));
        assert!(!is_handed_out(&mut stream, &header(Kind::Data, 2, 900)));
        assert!(matches!(stream.admit(&header(Kind::End, 2, 900), || CHECKSUM, || Ok(())), Admission::End { seq: 2 }));
    }

    #[test]
    fn who_joins_misses_nothing_that_was_before() {
        let lost = |joins: bool| {
            let mut stream = stream();
            if joins {
                stream.join();
            }
            [40, 42].map(|seq| match stream.admit(&header(Kind::Data, seq, seq), || CHECKSUM, || Ok(())) {
                Admission::Message { lost_before } => Some(lost_before),
                _ => None,
            })
        };
        assert_eq!((lost(true), lost(false)), ([Some(0), Some(1)], [Some(39), Some(1)]));
    }

    #[test]
    fn what_the_sender_left_out_is_not_lost() {
        let mut stream = stream();
        let mut lost_before = |kind, seq| match stream.admit(&header(kind, seq, seq), || CHECKSUM, || Ok(())) {
            Admission::Message { lost_before } => Some(lost_before),
            _ => None,
        };
        assert_eq!(lost_before(Kind::Data, 1), Some(0));
        for seq in [2, 3, 3, 1] {
            assert_eq!(lost_before(Kind::Skipped, seq), None);
        }
        // 4 was lost.
        assert_eq!(lost_before(Kind::Data, 5), Some(1));
        assert_eq!(lost_before(Kind::Skipped, 6), None);
        assert_eq!(lost_before(Kind::Data, 7), Some(0));
        assert_eq!(lost_before(Kind::Skipped, 8), None);
        // 9 was lost, the last one.
        assert_eq!(lost_before(Kind::End, 9), None);
        let (lost, passed) = (stream.account().borrow().counters.lost, stream.passed());
        assert_eq!((lost, passed), (2, 9));
    }

    #[test]
    fn a_restarted_numbering_is_refused_and_a_repetition_dropped() {
        let mut stream = stream();
        let counts = |stream: &Stream| (stream.account().borrow().counters.refused, stream.account().borrow().counters.repeated);
        assert!((1..=3).all(|seq| is_handed_out(&mut stream, &header(Kind::Data, seq, 100 * seq))));
        assert!(!is_handed_out(&mut stream, &header(Kind::Data, 2, 200)));
        assert_eq!(counts(&stream), (0, 1));
        assert!(!is_handed_out(&mut stream, &header(Kind::Data, 1, 400)));
        assert_eq!(counts(&stream), (1, 1));
        // Where only the last number is known, the two cannot be told apart.
        let mut restarted = self::stream();
        restarted.skip_to(3, 0);
        assert!(!is_handed_out(&mut restarted, &header(Kind::Data, 1, 400)));
        assert_eq!(counts(&restarted), (0, 1));
    }

    #[test]
    fn a_restart_refuses_what_was_refused_before_it() {
        let mut stream = stream();
        stream.skip_to(5, 1_000);
        assert_eq!((stream.passed(), answered(&stream, 4), answered(&stream, 5)), (5, 4, 5));
        assert!(!is_handed_out(&mut stream, &header(Kind::Data, 5, 1_000)), "it was already received");
        assert!(!is_handed_out(&mut stream, &header(Kind::Data, 6, 999)));
        assert!(is_handed_out(&mut stream, &header(Kind::Data, 7, 1_000)));
    }
}
