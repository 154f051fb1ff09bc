//! Lockstep: how many messages may be on the way.

use std::collections::VecDeque;

/// Limits the number of messages between playback and its slowest consumer.
///
/// Once full, it opens again when half of it is free: consumers answer in bursts, and playback wakes less often.
#[derive(Debug, Clone)]
pub struct Window {
    size: usize,
    /// Messages on the way, oldest first; numbers may be missing in a log.
    outstanding: VecDeque<u64>,
    /// The last message that every consumer has answered.
    floor: u64,
    open: bool,
}

impl Window {
    /// A window of `size` messages, at least 1.
    #[must_use]
    pub fn new(size: u32) -> Self {
        Self { size: (size as usize).max(1), outstanding: VecDeque::new(), floor: 0, open: true }
    }

    /// Changes the size, at least 1.
    pub fn resize(&mut self, size: u32) {
        self.size = (size as usize).max(1);
        self.answered(self.floor);
    }

    /// Every consumer has answered all messages up to `floor`.
    pub fn answered(&mut self, floor: u64) {
        self.floor = floor;
        while self.outstanding.front().is_some_and(|seq| *seq <= floor) {
            self.outstanding.pop_front();
        }
        if self.outstanding.len() <= self.size / 2 {
            self.open = true;
        }
    }

    /// Whether one more message may be sent.
    #[must_use]
    pub fn has_room(&self) -> bool {
        self.open && self.outstanding.len() < self.size
    }

    /// A message was sent. One that every consumer has answered before takes no place.
    pub fn sent(&mut self, seq: u64) {
        if seq > self.floor {
            self.outstanding.push_back(seq);
        }
        if self.outstanding.len() >= self.size {
            self.open = false;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn a_full_window_opens_again_when_half_of_it_is_free() {
        let mut window = Window::new(4);
        for seq in 1..=4 {
            assert!(window.has_room());
            window.sent(seq);
        }
        assert!(!window.has_room());
        window.answered(1);
        assert!(!window.has_room(), "one place is not worth waking for");
        window.answered(2);
        assert!(window.has_room());
        window.sent(5);
        assert!(window.has_room(), "it stays open until it is full");
        window.sent(6);
        assert!(!window.has_room());
    }

    #[test]
    fn a_window_of_one_is_strict_turns() {
        let mut window = Window::new(1);
        for seq in 1..10 {
            assert!(window.has_room());
            window.sent(seq);
            assert!(!window.has_room());
            window.answered(seq - 1);
            assert!(!window.has_room());
            window.answered(seq);
        }
    }

    #[test]
    fn what_is_sent_again_takes_no_place() {
        let mut window = Window::new(2);
        window.answered(10);
        (5..=11).for_each(|seq| window.sent(seq));
        assert!(window.has_room());
        window.sent(12);
        assert!(!window.has_room());
        window.resize(4);
        assert!(window.has_room());
    }

    proptest! {
        /// With any gaps in the numbers and any order of answers, never more messages are on the way than fit, and it never gets stuck.
        #[test]
        fn never_too_far_ahead_and_never_stuck(size in 1u32..300, steps in prop::collection::vec((1u64..1_000, 0usize..300), 1..300)) {
            let mut window = Window::new(size);
            let mut sent: Vec<u64> = Vec::new();
            let mut answered = 0;
            let mut numbers = steps.iter().scan(0, |seq, (gap, _)| { *seq += gap; Some(*seq) }).peekable();
            for (_, consumed) in &steps {
                while window.has_room() {
                    let Some(seq) = numbers.next() else { break };
                    window.sent(seq);
                    sent.push(seq);
                }
                prop_assert!(sent.len() - answered <= size as usize);
                prop_assert!(answered < sent.len() || numbers.peek().is_none(), "nothing on the way and nothing sent");
                answered = sent.len().min(answered + consumed);
                if answered > 0 {
                    window.answered(sent[answered - 1]);
                }
            }
            window.answered(sent.last().copied().unwrap_or_default());
            prop_assert!(window.has_room());
        }
    }
}
