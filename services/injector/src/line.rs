//! What becomes of the messages of one service.

use std::collections::VecDeque;

use settings::{PlannedFault, StreamFault};

use crate::chance::{draw, happens};
use crate::timetable::Phase;
use crate::words::{News, Wish};

/// Most messages held back; the oldest goes on when there are more, as a full buffer would have it.
const MOST_HELD: usize = 4096;
/// Most bits turned over in one message.
const MOST_BITS: u64 = 8;

/// What the line carries.
pub trait Cargo: Clone {
    /// Its place in the stream.
    fn seq(&self) -> u64;
    /// Its sensor time, ns.
    fn stamp_ns(&self) -> u64;
    /// Whether it says that the stream ends.
    fn is_end(&self) -> bool;
    /// Turns over a bit of what it says.
    fn turn_over(&mut self, bit: u64);
    /// Leaves only the word that it does not come.
    fn leave_gap(&mut self);
    /// Puts its sensor time forward.
    fn put_forward(&mut self, by_ns: u64);
}

/// What has been done to the messages of a service.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Counts {
    /// Messages taken.
    pub taken: u64,
    /// Messages left out.
    pub dropped: u64,
    /// Messages sent twice.
    pub duplicated: u64,
    /// Messages that the one behind them has overtaken.
    pub overtaken: u64,
    /// Messages with bits turned over.
    pub corrupted: u64,
    /// Messages held back for a while.
    pub held: u64,
    /// Messages stamped by a clock that was set.
    pub set_forward: u64,
}

/// The messages of one service on their way through the injector.
///
/// Times of messages are sensor time, the schedule of faults too; how long a message is held is deployment time. The end of
/// a stream is never left out, changed or overtaken: without it nobody could end in order. The schedule goes by the stamps as
/// they come.
#[derive(Debug, Clone)]
pub struct Line<C> {
    faults: Vec<Scheduled>,
    /// Stamp of the first message, ns.
    began_ns: Option<u64>,
    newest_ns: u64,
    /// What is left out is told to readers.
    tells_gaps: bool,
    /// Messages and when they may go on, ns of deployment time.
    held: VecDeque<(u64, C)>,
    /// A message that waits for the next one.
    overtaken: Option<C>,
    counts: Counts,
    /// What has not been taken of what is to be told.
    news: Vec<News>,
}

#[derive(Debug, Clone)]
struct Scheduled {
    kind: StreamFault,
    plan: PlannedFault,
    wish: Wish,
    /// What has been told of it.
    phase: Phase,
    seed: u64,
    by_ns: u64,
    /// Sensor time that `from_s` counts from; that of the first message when not given.
    since_ns: Option<u64>,
}

impl<C: Cargo> Line<C> {
    /// A line without faults. `began_ns` is the stamp of the stream's first message, when an earlier incarnation has seen it.
    ///
    /// With `tells_gaps` readers are told what is left out, which lockstep needs: nothing is sent before they have answered,
    /// and what never came nobody could answer.
    #[must_use]
    pub fn new(began_ns: Option<u64>, tells_gaps: bool) -> Self {
        Self {
            faults: Vec::new(),
            tells_gaps,
            began_ns,
            newest_ns: 0,
            held: VecDeque::new(),
            overtaken: None,
            counts: Counts::default(),
            news: Vec::new(),
        }
    }

    /// Adds a fault of the settings, which counts from the first message of the stream.
    pub fn plan(&mut self, kind: StreamFault, fault: &PlannedFault) {
        self.add(kind, fault, Wish::Set, None);
    }

    /// Adds a fault that somebody asks for; it counts from now.
    pub fn disturb(&mut self, kind: StreamFault, fault: &PlannedFault) {
        let since_ns = self.began_ns.map(|_| self.newest_ns);
        self.add(kind, fault, Wish::Asked, since_ns);
    }

    fn add(&mut self, kind: StreamFault, fault: &PlannedFault, wish: Wish, since_ns: Option<u64>) {
        self.faults.push(Scheduled {
            kind,
            plan: fault.clone(),
            wish,
            phase: Phase::Before,
            // Two faults of one seed do not hit the same messages.
            seed: u64::from(fault.seed.get()) | (self.faults.len() as u64 + 1) << 32,
            by_ns: (fault.by_s.unwrap_or_default().get() * 1e9) as u64,
            since_ns,
        });
    }

    /// Takes a message at deployment time `now_ns`; what goes on at once is appended to `out`.
    pub fn take(&mut self, mut message: C, now_ns: u64, out: &mut Vec<C>) {
        let began_ns = *self.began_ns.get_or_insert(message.stamp_ns());
        self.newest_ns = self.newest_ns.max(message.stamp_ns());
        self.counts.taken += 1;
        let (seq, end) = (message.seq(), message.is_end());
        let mut until_ns = 0;
        let (mut copies, mut overtaken, mut forward_ns) = (1, false, 0_u64);
        for fault in &mut self.faults {
            self.news.extend(fault.news(began_ns, message.stamp_ns(), end));
            let active = fault.is_active(began_ns, message.stamp_ns());
            if !active || !happens(fault.seed, seq, fault.plan.rate.get()) {
                continue;
            }
            match fault.kind {
                StreamFault::Delay => until_ns = until_ns.max(now_ns.saturating_add(fault.by_ns)),
                StreamFault::Burst => until_ns = until_ns.max(next_multiple(now_ns, fault.by_ns)),
                StreamFault::Stall => until_ns = until_ns.max(now_ns.saturating_add(fault.rest_ns(began_ns, message.stamp_ns()))),
                _ if end => {}
                StreamFault::Drop => copies = 0,
                StreamFault::Duplicate => copies = copies.min(1) * 2,
                StreamFault::Reorder => overtaken = true,
                StreamFault::Clock => forward_ns = forward_ns.saturating_add(fault.by_ns),
                StreamFault::Corrupt => {
                    self.counts.corrupted += 1;
                    for turn in 0..=draw(fault.seed, seq, 1) % MOST_BITS {
                        message.turn_over(draw(fault.seed, seq, 2 + turn));
                    }
                }
            }
        }
        if forward_ns > 0 {
            message.put_forward(forward_ns);
        }
        self.counts.set_forward += u64::from(forward_ns > 0);
        self.counts.dropped += u64::from(copies == 0);
        self.counts.duplicated += u64::from(copies == 2);
        self.counts.held += u64::from(until_ns > now_ns);
        if overtaken && copies > 0 && self.overtaken.is_none() {
            self.counts.overtaken += 1;
            self.overtaken = Some(message);
            return self.release(now_ns, out);
        }
        if copies == 0 && self.tells_gaps {
            message.leave_gap();
            self.held.push_back((until_ns, message));
            return self.release(now_ns, out);
        }
        let before = if end { self.overtaken.take() } else { None };
        let sent = std::iter::repeat_n(message, copies);
        self.held.extend(before.into_iter().chain(sent).map(|message| (until_ns, message)));
        if copies > 0 {
            self.held.extend(self.overtaken.take().map(|message| (until_ns, message)));
        }
        self.release(now_ns, out);
    }

    /// Lets go what is due at deployment time `now_ns`, in the order it came.
    pub fn release(&mut self, now_ns: u64, out: &mut Vec<C>) {
        while self.held.len() > MOST_HELD || self.held.front().is_some_and(|(until_ns, _)| *until_ns <= now_ns) {
            out.extend(self.held.pop_front().map(|(_, message)| message));
        }
    }

    /// When something is due, ns of deployment time.
    #[must_use]
    pub fn due_ns(&self) -> Option<u64> {
        self.held.front().map(|(until_ns, _)| *until_ns)
    }

    /// Lets go everything: the injector ends.
    pub fn flush(&mut self, out: &mut Vec<C>) {
        out.extend(self.held.drain(..).map(|(_, message)| message).chain(self.overtaken.take()));
    }

    /// Stamp of the first message, ns.
    #[must_use]
    pub fn began_ns(&self) -> Option<u64> {
        self.began_ns
    }

    /// What has been done so far.
    #[must_use]
    pub fn counts(&self) -> Counts {
        self.counts
    }

    /// What is to be told of the faults since this was last asked.
    pub fn take_news(&mut self) -> Vec<News> {
        std::mem::take(&mut self.news)
    }
}

impl Scheduled {
    /// Time within the fault, s; negative before it.
    fn within_s(&self, began_ns: u64, stamp_ns: u64) -> f64 {
        let since_ns = self.since_ns.unwrap_or(began_ns);
        (stamp_ns as f64 - since_ns as f64) * 1e-9 - self.plan.from_s.get()
    }

    fn is_active(&self, began_ns: u64, stamp_ns: u64) -> bool {
        (0.0..self.plan.for_s.get()).contains(&self.within_s(began_ns, stamp_ns))
    }

    /// What a message tells of it: that it begins with the first one in its time, or is over with one behind that or with the end.
    fn news(&mut self, began_ns: u64, stamp_ns: u64, end: bool) -> Option<News> {
        match self.phase {
            Phase::Before if !end && self.is_active(began_ns, stamp_ns) => {
                self.phase = Phase::Under;
                Some(News::begins(&self.plan, self.wish))
            }
            Phase::Under if end || self.within_s(began_ns, stamp_ns) >= self.plan.for_s.get() => {
                self.phase = Phase::Over;
                Some(News::over(&self.plan))
            }
            _ => None,
        }
    }

    /// Until its end, ns.
    fn rest_ns(&self, began_ns: u64, stamp_ns: u64) -> u64 {
        ((self.plan.for_s.get() - self.within_s(began_ns, stamp_ns)).max(0.0) * 1e9) as u64
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

    impl Cargo for Letter {
        fn seq(&self) -> u64 {
            self.seq
        }
        fn stamp_ns(&self) -> u64 {
            self.seq * TENTH_NS
        }
        fn is_end(&self) -> bool {
            self.end
        }
        fn turn_over(&mut self, bit: u64) {
            self.bits ^= 1 << (bit % 64);
        }
        fn leave_gap(&mut self) {
            self.is_gap = true;
        }
        fn put_forward(&mut self, by_ns: u64) {
            self.forward_ns += by_ns;
        }
    }

    fn fault(kind: StreamFault, change: impl Fn(&mut PlannedFault)) -> (StreamFault, PlannedFault) {
        let mut fault = PlannedFault::always(Disturbance::Service { service: RoutedService::RobotScan, fault: kind });
        change(&mut fault);
        (kind, fault)
    }

    /// Sends 1 to `last` and the end, each at its own time; what arrived with when it did, in tenths of a second.
    fn carried(last: u64, faults: &[(StreamFault, PlannedFault)]) -> (Vec<(u64, Letter)>, Counts) {
        let mut line = Line::new(None, false);
        faults.iter().for_each(|(kind, fault)| line.plan(*kind, fault));
        let mut arrived = Vec::new();
        for tenth in 1..=last + 200 {
            let mut out = Vec::new();
            match tenth {
                _ if tenth <= last => {
                    line.take(Letter { seq: tenth, bits: 0, end: false, forward_ns: 0, is_gap: false }, tenth * TENTH_NS, &mut out)
                }
                _ if tenth == last + 1 => {
                    line.take(Letter { seq: last, bits: 0, end: true, forward_ns: 0, is_gap: false }, tenth * TENTH_NS, &mut out)
                }
                _ => line.release(tenth * TENTH_NS, &mut out),
            }
            arrived.extend(out.into_iter().map(|letter| (tenth, letter)));
        }
        (arrived, line.counts())
    }

    fn seqs(arrived: &[(u64, Letter)]) -> Vec<u64> {
        arrived.iter().map(|(_, letter)| letter.seq).collect()
    }

    #[test]
    fn without_faults_everything_goes_on_at_once() {
        let (arrived, counts) = carried(5, &[]);
        assert_eq!(seqs(&arrived), [1, 2, 3, 4, 5, 5]);
        assert!(arrived[5].1.end && arrived.iter().take(5).all(|(tenth, letter)| *tenth == letter.seq));
        assert_eq!(counts, Counts { taken: 6, ..Counts::default() });
    }

    #[test]
    fn each_kind_does_its_one_thing_within_its_time() {
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
        assert_eq!((seqs(&arrived), counts.overtaken), (vec![1, 2, 3, 5, 4, 6, 7, 7], 1));
        let (arrived, _) = carried(7, &[fault(StreamFault::Delay, some)]);
        assert_eq!(arrived.iter().map(|(tenth, _)| *tenth).collect::<Vec<_>>(), [1, 2, 3, 7, 8, 8, 8, 8]);
        let (arrived, counts) = carried(7, &[fault(StreamFault::Stall, some)]);
        assert_eq!((arrived.iter().map(|(tenth, _)| *tenth).collect::<Vec<_>>(), counts.held), (vec![1, 2, 3, 6, 6, 6, 7, 8], 2));
        let (arrived, _) = carried(7, &[fault(StreamFault::Burst, some)]);
        assert_eq!(arrived.iter().map(|(tenth, _)| *tenth).collect::<Vec<_>>(), [1, 2, 3, 6, 6, 6, 7, 8]);
        let (arrived, counts) = carried(7, &[fault(StreamFault::Corrupt, some)]);
        let damaged: Vec<u64> = arrived.iter().filter(|(_, letter)| letter.bits != 0).map(|(_, letter)| letter.seq).collect();
        assert_eq!((damaged, counts.corrupted), (vec![4, 5], 2));
        let (arrived, counts) = carried(7, &[fault(StreamFault::Clock, some)]);
        let set: Vec<u64> = arrived.iter().map(|(_, letter)| letter.forward_ns / TENTH_NS).collect();
        assert_eq!((set, counts.set_forward), (vec![0, 0, 0, 3, 3, 0, 0, 0], 2));
    }

    #[test]
    fn in_lockstep_what_is_left_out_is_told_in_its_place() {
        let mut line = Line::new(None, true);
        let (kind, fault) = fault(StreamFault::Drop, |fault| fault.from_s = 0.2.try_into().unwrap());
        line.plan(kind, &fault);
        let mut out = Vec::new();
        (1..=4).for_each(|seq| line.take(Letter { seq, bits: 0, end: seq == 4, forward_ns: 0, is_gap: false }, seq, &mut out));
        assert_eq!(
            out.iter().map(|letter| (letter.seq, letter.is_gap)).collect::<Vec<_>>(),
            [(1, false), (2, false), (3, true), (4, false)]
        );
        assert_eq!(line.counts().dropped, 1);
    }

    #[test]
    fn a_fault_is_told_with_the_first_message_that_it_may_hit_and_with_the_first_behind_it() {
        let letter = |seq, end| Letter { seq, bits: 0, end, forward_ns: 0, is_gap: false };
        let told = |line: &mut Line<Letter>, seqs: std::ops::RangeInclusive<u64>, end| {
            let each = seqs.flat_map(|seq| {
                line.take(letter(seq, end), seq * TENTH_NS, &mut Vec::new());
                line.take_news().into_iter().map(|news| (seq, news)).collect::<Vec<_>>()
            });
            each.collect::<Vec<_>>()
        };
        let mut line = Line::new(None, false);
        // Messages 4 and 5; it hits none of them.
        let (kind, planned) = fault(StreamFault::Drop, |fault| {
            (fault.from_s, fault.for_s) = (0.3.try_into().unwrap(), 0.2.try_into().unwrap());
            fault.rate = 0.0.try_into().unwrap();
        });
        line.plan(kind, &planned);
        let (begins, over) = (News::begins(&planned, Wish::Set), News::over(&planned));
        assert_eq!(told(&mut line, 1..=9, false), [(4, begins), (6, over)]);
        let (kind, asked) = fault(StreamFault::Corrupt, |fault| fault.for_s = 1.0.try_into().unwrap());
        line.disturb(kind, &asked);
        assert_eq!(told(&mut line, 10..=12, false), [(10, News::begins(&asked, Wish::Asked))]);
        assert_eq!(told(&mut line, 12..=12, true), [(12, News::over(&asked))], "nothing comes behind the end");
    }

    #[test]
    fn a_message_that_is_sent_again_meets_the_same_fault() {
        let half = |fault: &mut PlannedFault| fault.rate = 0.5.try_into().unwrap();
        let mut line = Line::new(None, false);
        let (kind, fault) = fault(StreamFault::Drop, half);
        line.plan(kind, &fault);
        let pass = |line: &mut Line<Letter>| {
            let mut out = Vec::new();
            (1..=100).for_each(|seq| line.take(Letter { seq, bits: 0, end: false, forward_ns: 0, is_gap: false }, seq, &mut out));
            out
        };
        let first = pass(&mut line);
        assert!((30..70).contains(&first.len()));
        assert_eq!(pass(&mut line), first);
    }

    proptest! {
        /// Whatever the faults, nothing is made up, the end comes last and once, and what is not dropped arrives.
        #[test]
        fn nothing_is_made_up_and_the_end_comes_last(
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
                prop_assert!(arrived.windows(2).all(|pair| pair[0].1.seq <= pair[1].1.seq), "order is kept");
            }
        }
    }
}
