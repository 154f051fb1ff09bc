//! How far playback may run ahead of those who listen.

use std::collections::{BTreeMap, VecDeque};

/// Holds back at the source: no more than `window` messages are on their way to the slowest consumer.
///
/// Once the window is full it opens again when half of it has been answered, so that a fast replay wakes its processes once
/// for many messages and not for each.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Lockstep {
    window: usize,
    /// Last number that each consumer has answered for.
    answered: BTreeMap<String, u64>,
    /// Numbers sent that the slowest has not answered for.
    under_way: VecDeque<u64>,
    full: bool,
}

impl Lockstep {
    /// A window of at least one message over these consumers; without consumers nothing holds back.
    #[must_use]
    pub fn new(window: usize, consumers: impl IntoIterator<Item = String>) -> Self {
        let answered = consumers.into_iter().map(|name| (name, 0)).collect();
        Self { window: window.max(1), answered, under_way: VecDeque::new(), full: false }
    }

    /// A consumer has answered for everything up to `seq`; what others say is of no matter.
    pub fn answer(&mut self, consumer: &str, seq: u64) {
        if let Some(answered) = self.answered.get_mut(consumer) {
            *answered = seq.max(*answered);
        }
        while self.under_way.front().is_some_and(|seq| self.is_answered(*seq)) {
            self.under_way.pop_front();
        }
        if self.under_way.len() * 2 <= self.window {
            self.full = false;
        }
    }

    /// Whether every consumer has answered for this message: then it need not be sent again.
    #[must_use]
    pub fn is_answered(&self, seq: u64) -> bool {
        self.slowest().is_some_and(|slowest| seq <= slowest)
    }

    /// Whether another message may be sent.
    #[must_use]
    pub fn is_open(&self) -> bool {
        !self.full
    }

    /// A message has been sent.
    pub fn sent(&mut self, seq: u64) {
        if !self.answered.is_empty() && !self.is_answered(seq) {
            self.under_way.push_back(seq);
        }
        self.full = self.under_way.len() >= self.window;
    }

    /// Last number that every consumer has answered for.
    fn slowest(&self) -> Option<u64> {
        self.answered.values().min().copied()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lockstep(window: usize) -> Lockstep {
        Lockstep::new(window, ["mapping".to_owned(), "recorder".to_owned()])
    }

    /// Sends from `next` on until the window is full; the next number.
    fn send(lockstep: &mut Lockstep, mut next: u64) -> u64 {
        while lockstep.is_open() {
            lockstep.sent(next);
            next += 1;
        }
        next
    }

    #[test]
    fn no_further_than_the_window_beyond_the_slowest() {
        let mut lockstep = lockstep(8);
        assert_eq!(send(&mut lockstep, 1), 9);
        lockstep.answer("mapping", 8);
        assert!(!lockstep.is_open(), "the recorder has answered nothing");
        lockstep.answer("recorder", 3);
        assert!(!lockstep.is_open(), "five are under way: more than half");
        lockstep.answer("recorder", 4);
        assert_eq!(send(&mut lockstep, 9), 13);
        lockstep.answer("viewer", 100);
        assert_eq!(lockstep.slowest(), Some(4));
    }

    #[test]
    fn a_gap_wider_than_the_window_does_not_jam() {
        let mut lockstep = lockstep(4);
        for seq in [1, 2, 1000, 1001] {
            lockstep.sent(seq);
        }
        assert!(!lockstep.is_open());
        lockstep.answer("mapping", 1001);
        lockstep.answer("recorder", 1000);
        assert!(lockstep.is_open());
    }

    #[test]
    fn an_answer_is_never_taken_back() {
        let mut lockstep = lockstep(4);
        lockstep.answer("mapping", 10);
        lockstep.answer("recorder", 12);
        lockstep.answer("mapping", 3);
        assert_eq!(lockstep.slowest(), Some(10));
    }

    #[test]
    fn what_is_sent_again_fills_no_window() {
        let mut lockstep = lockstep(4);
        lockstep.answer("mapping", 100);
        lockstep.answer("recorder", 100);
        for seq in 50..=100 {
            lockstep.sent(seq);
        }
        assert!(lockstep.is_open());
    }

    #[test]
    fn nobody_listens() {
        let mut alone = Lockstep::new(4, []);
        for seq in 1..1000 {
            assert!(alone.is_open());
            alone.sent(seq);
        }
    }
}
