//! When packets arrived: the stamp of a packet is the arrival of its first byte.

use std::collections::VecDeque;

use crate::odometry::CYCLE_S;

/// A status packet every tenth of a second, ns.
const CYCLE_NS: u64 = (CYCLE_S * 1e9) as u64;

/// Packets that the measured rhythm is taken over.
const RHYTHM_PACKETS: usize = 64;

/// A longer silence is none of the rhythm, ns.
const LONGEST_NS: u64 = 10 * CYCLE_NS;

/// The rhythm of the packets as they arrive.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Rhythm {
    /// Mean time between two packets, s; 0 before the second packet.
    pub interval_s: f64,
    /// Mean deviation from it, s.
    pub jitter_s: f64,
}

/// Gives packets their stamps.
#[derive(Debug, Clone, Default)]
pub struct Arrivals {
    /// Where in the stream each read began, and when it was; those that an open packet may have begun in.
    reads: VecDeque<(u64, u64)>,
    last_stamp_ns: u64,
    /// The last stamps, without a silence between them.
    recent: VecDeque<u64>,
}

impl Arrivals {
    /// Stamps continue after `last_stamp_ns`.
    #[must_use]
    pub fn after(last_stamp_ns: u64) -> Self {
        Self { last_stamp_ns, ..Self::default() }
    }

    /// The rhythm of the packets as they arrive.
    #[must_use]
    pub fn rhythm(&self) -> Rhythm {
        let intervals = || self.recent.iter().zip(self.recent.iter().skip(1)).map(|(before, after)| (after - before) as f64 / 1e9);
        let count = intervals().count().max(1) as f64;
        let interval_s = intervals().sum::<f64>() / count;
        Rhythm { interval_s, jitter_s: intervals().map(|interval| (interval - interval_s).abs()).sum::<f64>() / count }
    }

    /// Says that this stamp has been given, too.
    pub fn note_stamp(&mut self, stamp_ns: u64) {
        self.last_stamp_ns = self.last_stamp_ns.max(stamp_ns);
    }

    /// Notes a read: the stream position of its first byte, and when it was.
    pub fn note_read(&mut self, start: u64, now_ns: u64) {
        self.reads.push_back((start, now_ns));
    }

    /// The stamps of status packets that one read completed, by the stream positions of their first bytes. `open_from` is the
    /// position from which on the stream is still undecided.
    ///
    /// Of several packets that began in the same read, all but the last have been waiting to be read (this process, or the
    /// machine, was held up): they are put back by a cycle each, though not before what came earlier. Stamps grow strictly.
    pub fn stamps(&mut self, starts: &[u64], open_from: u64) -> Vec<u64> {
        let mut stamps = Vec::with_capacity(starts.len());
        for (place, &start) in starts.iter().enumerate() {
            let (read_from, read_ns) = self.read_of(start);
            let waiting = starts[place..].iter().filter(|&&later| self.read_of(later).0 == read_from).count() as u64;
            let room_ns = read_ns.saturating_sub(self.last_stamp_ns);
            let spacing_ns = (room_ns / waiting.max(1)).min(CYCLE_NS);
            let stamp_ns = read_ns.saturating_sub(spacing_ns * (waiting - 1)).max(self.last_stamp_ns + 1);
            self.remember(stamp_ns);
            stamps.push(stamp_ns);
        }
        while self.reads.get(1).is_some_and(|&(start, _)| start <= open_from) {
            self.reads.pop_front();
        }
        stamps
    }

    /// The read that the byte at this position came with.
    fn read_of(&self, position: u64) -> (u64, u64) {
        let after = self.reads.partition_point(|&(start, _)| start <= position);
        self.reads.get(after.saturating_sub(1)).copied().unwrap_or_default()
    }

    fn remember(&mut self, stamp_ns: u64) {
        if stamp_ns - self.last_stamp_ns > LONGEST_NS {
            self.recent.clear();
        }
        if self.recent.len() > RHYTHM_PACKETS {
            self.recent.pop_front();
        }
        self.recent.push_back(stamp_ns);
        self.last_stamp_ns = stamp_ns;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: u64 = 1_000_000;

    #[test]
    fn the_stamp_is_the_arrival_of_the_first_byte() {
        let mut arrivals = Arrivals::default();
        arrivals.note_read(0, 500 * MS);
        assert!(arrivals.stamps(&[], 0).is_empty());
        arrivals.note_read(20, 540 * MS);
        assert_eq!(arrivals.stamps(&[0], 40), [500 * MS]);
    }

    #[test]
    fn packets_that_waited_are_put_back() {
        let mut arrivals = Arrivals::default();
        arrivals.note_read(0, 1000 * MS);
        arrivals.stamps(&[0], 60);
        arrivals.note_read(60, 1420 * MS);
        assert_eq!(arrivals.stamps(&[60, 120, 180, 240], 300), [1120 * MS, 1220 * MS, 1320 * MS, 1420 * MS]);
        // Closer together than a cycle: spread over the time there was.
        arrivals.note_read(300, 1450 * MS);
        assert_eq!(arrivals.stamps(&[300, 360, 420], 480), [1430 * MS, 1440 * MS, 1450 * MS]);
    }

    #[test]
    fn stamps_grow_whatever_the_clock_says() {
        let mut arrivals = Arrivals::after(2000 * MS);
        arrivals.note_read(0, 1000 * MS);
        assert_eq!(arrivals.stamps(&[0, 60], 120), [2000 * MS + 1, 2000 * MS + 2]);
    }

    #[test]
    fn the_rhythm_is_measured() {
        let mut arrivals = Arrivals::default();
        for packet in 0..300 {
            let late = if packet % 2 == 0 { 0 } else { 16 };
            arrivals.note_read(packet * 60, (1000 + packet * 100 + late) * MS);
            arrivals.stamps(&[packet * 60], (packet + 1) * 60);
        }
        let Rhythm { interval_s, jitter_s } = arrivals.rhythm();
        assert!((interval_s - 0.1).abs() < 1e-9 && (jitter_s - 0.016).abs() < 1e-9, "{interval_s} {jitter_s}");
        arrivals.note_read(300 * 60, 99_000 * MS);
        arrivals.stamps(&[300 * 60], 301 * 60);
        assert_eq!(arrivals.rhythm(), Rhythm::default(), "after a silence it begins anew");
    }

    #[test]
    fn reads_of_complete_packets_are_dropped() {
        let mut arrivals = Arrivals::default();
        for read in 0..1000 {
            arrivals.note_read(read, read * MS);
            arrivals.stamps(&[], read.saturating_sub(9));
        }
        assert!(arrivals.reads.len() <= 11, "{}", arrivals.reads.len());
    }
}
