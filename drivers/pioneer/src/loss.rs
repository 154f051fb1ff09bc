//! How many packets are lost: a robot sends at a steady rhythm, so a hole in it is a packet that did not arrive intact.

use std::collections::VecDeque;

/// Intervals that the share is taken over: 6.4 s at ten packets a second.
const WINDOW: usize = 64;

/// Fewer intervals say nothing.
const LEAST: usize = 16;

/// A silence of more cycles than this is a line that was dead for a while, not packets that were lost one by one.
const LONGEST_HOLE: f64 = 10.0;

/// Fewer holes than this are accidents.
const LEAST_HOLES: usize = 4;

/// The share of lost packets over the last seconds.
#[derive(Debug, Clone, Default)]
pub(crate) struct PacketLoss {
    last_ns: Option<u64>,
    intervals_ns: VecDeque<u64>,
    lost: u64,
}

impl PacketLoss {
    /// Takes the stamp of the next status packet that arrived intact, whatever becomes of it.
    pub(crate) fn note(&mut self, stamp_ns: u64) {
        if let Some(last_ns) = self.last_ns.replace(stamp_ns) {
            if self.intervals_ns.len() == WINDOW {
                self.intervals_ns.pop_front();
            }
            self.intervals_ns.push_back(stamp_ns.saturating_sub(last_ns));
            self.lost += self.missed(stamp_ns.saturating_sub(last_ns), self.cycle_ns()) as u64;
        }
    }

    /// The link is down: the rhythm begins anew.
    pub(crate) fn restart(&mut self) {
        self.last_ns = None;
        self.intervals_ns.clear();
    }

    /// Packets lost so far, as far as the rhythm tells.
    pub(crate) fn lost(&self) -> u64 {
        self.lost
    }

    /// Share of the packets that were lost lately, 0 to 1.
    pub(crate) fn share(&self) -> f64 {
        let cycle_ns = self.cycle_ns();
        let holes: Vec<f64> = self.intervals_ns.iter().map(|&ns| self.missed(ns, cycle_ns)).filter(|&missed| missed > 0.0).collect();
        if holes.len() < LEAST_HOLES {
            return 0.0;
        }
        let lost: f64 = holes.iter().sum();
        lost / (lost + self.intervals_ns.len() as f64)
    }

    /// Packets that should have come within an interval.
    fn missed(&self, interval_ns: u64, cycle_ns: u64) -> f64 {
        if self.intervals_ns.len() < LEAST || cycle_ns == 0 {
            return 0.0;
        }
        let cycles = (interval_ns as f64 / cycle_ns as f64).round();
        if cycles > LONGEST_HOLE { 0.0 } else { (cycles - 1.0).max(0.0) }
    }

    /// The robot's own rhythm: the lower quartile of the intervals is free of losses up to a loss of three packets in four.
    fn cycle_ns(&self) -> u64 {
        let mut sorted: Vec<u64> = self.intervals_ns.iter().copied().collect();
        sorted.sort_unstable();
        sorted.get(sorted.len() / 4).copied().unwrap_or(0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: u64 = 1_000_000;

    #[track_caller]
    fn check(share: std::ops::RangeInclusive<f64>, stamps_ms: impl Iterator<Item = u64>) {
        let mut loss = PacketLoss::default();
        stamps_ms.for_each(|stamp_ms| loss.note(stamp_ms * MS));
        assert!(share.contains(&loss.share()), "{}", loss.share());
    }

    #[test]
    fn a_steady_rhythm_has_no_loss_whatever_its_pace() {
        for cycle_ms in [20, 50, 100, 500, 1000] {
            check(0.0..=0.0, (0..200).map(|k| k * cycle_ms));
        }
        check(0.0..=0.0, (0..200).map(|k| k * 100 + 16 * (k % 2)));
        check(0.0..=0.0, (0..10).map(|k| k * k * 100));
        check(0.0..=0.0, (0..60).map(|k| k * 100 + if k < 30 { 0 } else { 7000 }));
        check(0.0..=0.0, (0..60).map(|k| k * 100 + if k < 30 { 0 } else { 600 }));
    }

    #[test]
    fn lost_packets_are_counted() {
        check(0.28..=0.32, (0..200).filter(|k| k % 10 < 7).map(|k| k * 100));
        check(0.48..=0.52, (0..400).filter(|k| k % 4 < 2).map(|k| k * 100));
        let mut loss = PacketLoss::default();
        (0..1000).filter(|k| k % 10 != 0).for_each(|k| loss.note(k * 100 * MS));
        assert!((95..=99).contains(&loss.lost()), "{}", loss.lost());
    }
}
