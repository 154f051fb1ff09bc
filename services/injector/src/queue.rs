//! The messages of one service between its publishers and its readers.

use std::collections::VecDeque;

use settings::{PlannedFault, StreamFault};

use crate::describe::{Report, Source};
use crate::random::{draw, occurs};
use crate::schedule::Phase;

/// Most messages held back. Beyond that the oldest is released, as it would be by a full buffer.
const MOST_HELD: usize = 4096;
/// Most bits flipped in one message.
const MOST_BITS: u64 = 8;

/// A message with its header, as the queue sees it.
pub trait Envelope: Clone {
    /// Its sequence number in the stream.
    fn seq(&self) -> u64;
    /// Its sensor time, ns.
    fn stamp_ns(&self) -> u64;
    /// Whether it marks the end of the stream.
    fn is_end(&self) -> bool;
    /// Flips a bit of its payload.
    fn flip_bit(&mut self, bit: u64);
    /// Replaces it by the notice that it is missing.
    fn make_gap(&mut self);
    /// Advances its stamp.
    fn advance_stamp(&mut self, by_ns: u64);
}

/// What was done to the messages of a service.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Counts {
    /// Messages received.
    pub received: u64,
    /// Messages dropped.
    pub dropped: u64,
    /// Messages sent twice.
    pub duplicated: u64,
    /// Messages sent after the one that follows them.
    pub reordered: u64,
    /// Messages with flipped bits.
    pub corrupted: u64,
    /// Messages held back.
    pub delayed: u64,
    /// Messages with an advanced stamp.
    pub restamped: u64,
}

/// The messages of one service on their way through the injector.
///
/// Faults are scheduled in sensor time, by the stamps of the messages as they come; a message is held back for deployment time. The
/// end of a stream is never dropped, changed or overtaken: no reader could finish without it.
#[derive(Debug, Clone)]
pub struct FaultQueue<M> {
    faults: Vec<ActiveFault>,
    /// Stamp of the first message, ns.
    first_ns: Option<u64>,
    newest_ns: u64,
    /// Readers receive a notice for each dropped message.
    announces_gaps: bool,
    /// Messages with the times of their release, ns of deployment time.
    delayed: VecDeque<(u64, M)>,
    /// A message that is sent after the next one.
    overtaken: Option<M>,
    counts: Counts,
    reports: Vec<Report>,
}

#[derive(Debug, Clone)]
struct ActiveFault {
    kind: StreamFault,
    plan: PlannedFault,
    source: Source,
    /// Progress as it was reported.
    phase: Phase,
    seed: u64,
    by_ns: u64,
    /// Sensor time from which `from_s` counts; that of the first message if `None`.
    since_ns: Option<u64>,
}

impl<M: Envelope> FaultQueue<M> {
    /// A queue without faults. `first_ns` is the stamp of the first message of the stream, if an earlier incarnation received it.
    ///
    /// With `announces_gaps` readers receive a notice for each dropped message. Lockstep needs it: playback waits until every message
    /// is acknowledged, and a message that never comes cannot be.
    #[must_use]
    pub fn new(first_ns: Option<u64>, announces_gaps: bool) -> Self {
        Self {
            faults: Vec::new(),
            announces_gaps,
            first_ns,
            newest_ns: 0,
            delayed: VecDeque::new(),
            overtaken: None,
            counts: Counts::default(),
            reports: Vec::new(),
        }
    }

    /// Adds a fault. Its times count from the first message of the stream if it is of the settings, or from the newest message if it
    /// was requested.
    pub fn add(&mut self, kind: StreamFault, fault: &PlannedFault, source: Source) {
        let since_ns = match source {
            Source::Settings => None,
            Source::Request => self.first_ns.map(|_| self.newest_ns),
        };
        self.faults.push(ActiveFault {
            kind,
            plan: fault.clone(),
            source,
            phase: Phase::Pending,
            // Two faults of one seed must not hit the same messages.
            seed: u64::from(fault.seed.get()) | (self.faults.len() as u64 + 1) << 32,
            by_ns: (fault.by_s.unwrap_or_default().get() * 1e9) as u64,
            since_ns,
        });
    }

    /// Receives a message at deployment time `now_ns` and appends to `out` what is to be sent now.
    pub fn push(&mut self, mut message: M, now_ns: u64, out: &mut Vec<M>) {
        let first_ns = *self.first_ns.get_or_insert(message.stamp_ns());
        self.newest_ns = self.newest_ns.max(message.stamp_ns());
        self.counts.received += 1;
        let (seq, end) = (message.seq(), message.is_end());
        let mut until_ns = 0;
        let (mut copies, mut overtaken, mut forward_ns) = (1, false, 0_u64);
        for fault in &mut self.faults {
            self.reports.extend(fault.report(first_ns, message.stamp_ns(), end));
            let active = fault.is_active(first_ns, message.stamp_ns());
            if !active || !occurs(fault.seed, seq, fault.plan.rate.get()) {
                continue;
            }
            match fault.kind {
                StreamFault::Delay => until_ns = until_ns.max(now_ns.saturating_add(fault.by_ns)),
                StreamFault::Burst => until_ns = until_ns.max(next_multiple(now_ns, fault.by_ns)),
                StreamFault::Stall => until_ns = until_ns.max(now_ns.saturating_add(fault.rest_ns(first_ns, message.stamp_ns()))),
                _ if end => {}
                StreamFault::Drop => copies = 0,
                StreamFault::Duplicate => copies = copies.min(1) * 2,
                StreamFault::Reorder => overtaken = true,
                StreamFault::Clock => forward_ns = forward_ns.saturating_add(fault.by_ns),
                StreamFault::Corrupt => {
                    self.counts.corrupted += 1;
                    for turn in 0..=draw(fault.seed, seq, 1) % MOST_BITS {
                        message.flip_bit(draw(fault.seed, seq, 2 + turn));
                    }
                }
            }
        }
        if forward_ns > 0 {
            message.advance_stamp(forward_ns);
        }
        self.counts.restamped += u64::from(forward_ns > 0);
        self.counts.dropped += u64::from(copies == 0);
        self.counts.duplicated += u64::from(copies == 2);
        self.counts.delayed += u64::from(until_ns > now_ns);
        if overtaken && copies > 0 && self.overtaken.is_none() {
            self.counts.reordered += 1;
            self.overtaken = Some(message);
            return self.release(now_ns, out);
        }
        if copies == 0 && self.announces_gaps {
            message.make_gap();
            self.delayed.push_back((until_ns, message));
            return self.release(now_ns, out);
        }
        let before = if end { self.overtaken.take() } else { None };
        let sent = std::iter::repeat_n(message, copies);
        self.delayed.extend(before.into_iter().chain(sent).map(|message| (until_ns, message)));
        if copies > 0 {
            self.delayed.extend(self.overtaken.take().map(|message| (until_ns, message)));
        }
        self.release(now_ns, out);
    }

    /// Appends to `out` what is due at deployment time `now_ns`, in the order in which it was received.
    pub fn release(&mut self, now_ns: u64, out: &mut Vec<M>) {
        while self.delayed.len() > MOST_HELD || self.delayed.front().is_some_and(|(until_ns, _)| *until_ns <= now_ns) {
            out.extend(self.delayed.pop_front().map(|(_, message)| message));
        }
    }

    /// When the next message is due, ns of deployment time.
    #[must_use]
    pub fn due_ns(&self) -> Option<u64> {
        self.delayed.front().map(|(until_ns, _)| *until_ns)
    }

    /// Appends to `out` everything that is held back, when the injector ends.
    pub fn flush(&mut self, out: &mut Vec<M>) {
        out.extend(self.delayed.drain(..).map(|(_, message)| message).chain(self.overtaken.take()));
    }

    /// Stamp of the first message, ns.
    #[must_use]
    pub fn first_ns(&self) -> Option<u64> {
        self.first_ns
    }

    /// What was done to the messages so far.
    #[must_use]
    pub fn counts(&self) -> Counts {
        self.counts
    }

    /// Removes and returns the reports about faults.
    pub fn take_reports(&mut self) -> Vec<Report> {
        std::mem::take(&mut self.reports)
    }
}

impl ActiveFault {
    /// Time since the begin of the fault, s; negative before it.
    fn elapsed_s(&self, first_ns: u64, stamp_ns: u64) -> f64 {
        let since_ns = self.since_ns.unwrap_or(first_ns);
        (stamp_ns as f64 - since_ns as f64) * 1e-9 - self.plan.from_s.get()
    }

    fn is_active(&self, first_ns: u64, stamp_ns: u64) -> bool {
        (0.0..self.plan.for_s.get()).contains(&self.elapsed_s(first_ns, stamp_ns))
    }

    /// The report that is due with this message: the fault begins with the first message within its time, and ends with the first
    /// one after it or with the end of the stream.
    fn report(&mut self, first_ns: u64, stamp_ns: u64, end: bool) -> Option<Report> {
        match self.phase {
            Phase::Pending if !end && self.is_active(first_ns, stamp_ns) => {
                self.phase = Phase::Active;
                Some(Report::begins(&self.plan, self.source))
            }
            Phase::Active if end || self.elapsed_s(first_ns, stamp_ns) >= self.plan.for_s.get() => {
                self.phase = Phase::Ended;
                Some(Report::ended(&self.plan))
            }
            _ => None,
        }
    }

    /// Time until the end of the fault, ns.
    fn rest_ns(&self, first_ns: u64, stamp_ns: u64) -> u64 {
        ((self.plan.for_s.get() - self.elapsed_s(first_ns, stamp_ns)).max(0.0) * 1e9) as u64
    }
}

fn next_multiple(now_ns: u64, period_ns: u64) -> u64 {
    (now_ns / period_ns.max(1)).saturating_add(1).saturating_mul(period_ns)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use settings::{Disturbance, RoutedService};

    const TENTH_NS: u64 = 100_000_000;

    #[derive(Debug, Clone, Copy, PartialEq, Eq)]
    struct Letter {
        seq: u64,
        bits: u64,
        end: bool,
        forward_ns: u64,
        is_gap: bool,
    }

    impl Envelope for Letter {
        fn seq(&self) -> u64 {
            self.seq
        }
        fn stamp_ns(&self) -> u64 {
            self.seq * TENTH_NS
        }
        fn is_end(&self) -> bool {
            self.end
        }
        fn flip_bit(&mut self, bit: u64) {
            self.bits ^= 1 << (bit % 64);
        }
        fn make_gap(&mut self) {
            self.is_gap = true;
        }
        fn advance_stamp(&mut self, by_ns: u64) {
            self.forward_ns += by_ns;
        }
    }

    fn fault(kind: StreamFault, change: impl Fn(&mut PlannedFault)) -> (StreamFault, PlannedFault) {
        let mut fault = PlannedFault::always(Disturbance::Service { service: RoutedService::named("robot/scan").unwrap(), fault: kind });
        change(&mut fault);
        (kind, fault)
    }

    /// Sends 1 to `last` and the end, each at its own time. What arrived, with its time in tenths of a second.
    fn carried(last: u64, faults: &[(StreamFault, PlannedFault)]) -> (Vec<(u64, Letter)>, Counts) {
        let mut queue = FaultQueue::new(None, false);
        faults.iter().for_each(|(kind, fault)| queue.add(*kind, fault, Source::Settings));
        let mut arrived = Vec::new();
        for tenth in 1..=last + 200 {
            let mut out = Vec::new();
            match tenth {
                _ if tenth <= last => {
                    queue.push(Letter { seq: tenth, bits: 0, end: false, forward_ns: 0, is_gap: false }, tenth * TENTH_NS, &mut out)
                }
                _ if tenth == last + 1 => {
                    queue.push(Letter { seq: last, bits: 0, end: true, forward_ns: 0, is_gap: false }, tenth * TENTH_NS, &mut out)
                }
                _ => queue.release(tenth * TENTH_NS, &mut out),
            }
            arrived.extend(out.into_iter().map(|letter| (tenth, letter)));
        }
        (arrived, queue.counts())
    }

    fn seqs(arrived: &[(u64, Letter)]) -> Vec<u64> {
        arrived.iter().map(|(_, letter)| letter.seq).collect()
    }

    #[test]
    fn without_faults_messages_pass_at_once() {
        let (arrived, counts) = carried(5, &[]);
        assert_eq!(seqs(&arrived), [1, 2, 3, 4, 5, 5]);
        assert!(arrived[5].1.end && arrived.iter().take(5).all(|(tenth, letter)| *tenth == letter.seq));
        assert_eq!(counts, Counts { received: 6, ..Counts::default() });
    }

    #[test]
    fn each_fault_acts_within_its_time_only() {
        let some = |fault: &mut PlannedFault| {
            fault.from_s = 0.3.try_into().unwrap();
            fault.for_s = 0.2.try_into().unwrap();
            fault.by_s = Some(0.3.try_into().unwrap());
        };
        // Messages 4 and 5 are those from 0.3 s to 0.5 s after message 1.
        let (arrived, _) = carried(7, &[fault(StreamFault::Drop, some)]);
        assert_eq!(seqs(&arrived), [1, 2, 3, 6, 7, 7]);
        let (arrived, _) = carried(7, &[fault(StreamFault::Duplicate, some)]);
        assert_eq!(seqs(&arrived), [1, 2, 3, 4, 4, 5, 5, 6, 7, 7]);
        let (arrived, counts) = carried(7, &[fault(StreamFault::Reorder, some)]);
        assert_eq!((seqs(&arrived), counts.reordered), (vec![1, 2, 3, 5, 4, 6, 7, 7], 1));
        let (arrived, _) = carried(7, &[fault(StreamFault::Delay, some)]);
        assert_eq!(arrived.iter().map(|(tenth, _)| *tenth).collect::<Vec<_>>(), [1, 2, 3, 7, 8, 8, 8, 8]);
        let (arrived, counts) = carried(7, &[fault(StreamFault::Stall, some)]);
        assert_eq!((arrived.iter().map(|(tenth, _)| *tenth).collect::<Vec<_>>(), counts.delayed), (vec![1, 2, 3, 6, 6, 6, 7, 8], 2));
        let (arrived, _) = carried(7, &[fault(StreamFault::Burst, some)]);
        assert_eq!(arrived.iter().map(|(tenth, _)| *tenth).collect::<Vec<_>>(), [1, 2, 3, 6, 6, 6, 7, 8]);
        let (arrived, counts) = carried(7, &[fault(StreamFault::Corrupt, some)]);
        let damaged: Vec<u64> = arrived.iter().filter(|(_, letter)| letter.bits != 0).map(|(_, letter)| letter.seq).collect();
        assert_eq!((damaged, counts.corrupted), (vec![4, 5], 2));
        let (arrived, counts) = carried(7, &[fault(StreamFault::Clock, some)]);
        let set: Vec<u64> = arrived.iter().map(|(_, letter)| letter.forward_ns / TENTH_NS).collect();
        assert_eq!((set, counts.restamped), (vec![0, 0, 0, 3, 3, 0, 0, 0], 2));
    }

    #[test]
    fn in_lockstep_a_gap_replaces_a_dropped_message() {
        let mut queue = FaultQueue::new(None, true);
        let (kind, fault) = fault(StreamFault::Drop, |fault| fault.from_s = 0.2.try_into().unwrap());
        queue.add(kind, &fault, Source::Settings);
        let mut out = Vec::new();
        (1..=4).for_each(|seq| queue.push(Letter { seq, bits: 0, end: seq == 4, forward_ns: 0, is_gap: false }, seq, &mut out));
        assert_eq!(
            out.iter().map(|letter| (letter.seq, letter.is_gap)).collect::<Vec<_>>(),
            [(1, false), (2, false), (3, true), (4, false)]
        );
        assert_eq!(queue.counts().dropped, 1);
    }

    #[test]
    fn a_fault_is_reported_at_its_first_and_after_its_last_message() {
        let letter = |seq, end| Letter { seq, bits: 0, end, forward_ns: 0, is_gap: false };
        let reports = |queue: &mut FaultQueue<Letter>, seqs: std::ops::RangeInclusive<u64>, end| {
            let each = seqs.flat_map(|seq| {
                queue.push(letter(seq, end), seq * TENTH_NS, &mut Vec::new());
                queue.take_reports().into_iter().map(|report| (seq, report)).collect::<Vec<_>>()
            });
            each.collect::<Vec<_>>()
        };
        let mut queue = FaultQueue::new(None, false);
        // Its time is that of messages 4 and 5. Its rate of 0 hits none of them.
        let (kind, planned) = fault(StreamFault::Drop, |fault| {
            (fault.from_s, fault.for_s) = (0.3.try_into().unwrap(), 0.2.try_into().unwrap());
            fault.rate = 0.0.try_into().unwrap();
        });
        queue.add(kind, &planned, Source::Settings);
        let (begins, ended) = (Report::begins(&planned, Source::Settings), Report::ended(&planned));
        assert_eq!(reports(&mut queue, 1..=9, false), [(4, begins), (6, ended)]);
        let (kind, requested) = fault(StreamFault::Corrupt, |fault| fault.for_s = 1.0.try_into().unwrap());
        queue.add(kind, &requested, Source::Request);
        assert_eq!(reports(&mut queue, 10..=12, false), [(10, Report::begins(&requested, Source::Request))]);
        assert_eq!(reports(&mut queue, 12..=12, true), [(12, Report::ended(&requested))], "nothing comes after the end");
    }

    #[test]
    fn a_republished_message_meets_the_same_fault() {
        let half = |fault: &mut PlannedFault| fault.rate = 0.5.try_into().unwrap();
        let mut queue = FaultQueue::new(None, false);
        let (kind, fault) = fault(StreamFault::Drop, half);
        queue.add(kind, &fault, Source::Settings);
        let pass = |queue: &mut FaultQueue<Letter>| {
            let mut out = Vec::new();
            (1..=100).for_each(|seq| queue.push(Letter { seq, bits: 0, end: false, forward_ns: 0, is_gap: false }, seq, &mut out));
            out
        };
        let first = pass(&mut queue);
        assert!((30..70).contains(&first.len()));
        assert_eq!(pass(&mut queue), first);
    }

    proptest! {
        /// Under any faults, no message is invented, the end comes last and once, and every message that is not dropped arrives.
        #[test]
        fn no_message_is_invented_and_the_end_comes_last(
            kinds in prop::collection::vec((0usize..8, 0.0f64..=1.0, 0.0f64..3.0, 0.0f64..3.0, 0.001f64..1.0, 0u32..9), 0..5),
            last in 1u64..60,
        ) {
            const KINDS: [StreamFault; 8] = [
                StreamFault::Drop, StreamFault::Delay, StreamFault::Duplicate, StreamFault::Reorder,
                StreamFault::Corrupt, StreamFault::Stall, StreamFault::Burst, StreamFault::Clock,
            ];
            let faults: Vec<_> = kinds.iter().map(|(kind, rate, from_s, for_s, by_s, seed)| fault(KINDS[*kind], |fault| {
                fault.rate = (*rate).try_into().unwrap();
                fault.from_s = (*from_s).try_into().unwrap();
                fault.for_s = (*for_s).try_into().unwrap();
                fault.by_s = Some((*by_s).try_into().unwrap());
                fault.seed = (*seed).try_into().unwrap();
            })).collect();
            let (arrived, counts) = carried(last, &faults);
            prop_assert!(arrived.last().is_some_and(|(_, letter)| letter.end));
            prop_assert_eq!(arrived.iter().filter(|(_, letter)| letter.end).count(), 1);
            let distinct: std::collections::BTreeSet<u64> = arrived.iter().filter(|(_, l)| !l.end).map(|(_, l)| l.seq).collect();
            prop_assert_eq!(distinct.len() as u64 + counts.dropped, last);
            if !kinds.iter().any(|(kind, ..)| *kind == 3) {
                prop_assert!(arrived.windows(2).all(|pair| pair[0].1.seq <= pair[1].1.seq), "order");
            }
        }
    }
}
