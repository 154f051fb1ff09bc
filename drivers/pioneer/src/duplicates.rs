//! Packets that arrive twice: some serial bridges repeat what they send. A robot at rest sends equal packets, too.

use std::collections::VecDeque;

use psos::Sip;

/// Sum of the wheels' speeds, in the robot's units, from which on two packets of a robot differ: 20 mm/s move the counters by two
/// units between two packets.
const MOVING: i32 = 40;

/// Packets whose pace is taken.
const PACE_PACKETS: usize = 16;

/// Time in which that many packets come when each comes twice, ns. Ten packets a second take 1.5 s, twenty 0.75 s; packets that have
/// waited together take less.
const DOUBLED_NS: std::ops::Range<u64> = 300_000_000..910_000_000;

/// A packet and the same once more come closer together than this, ns: half a cycle.
const CLOSE_NS: u64 = 50_000_000;

/// Tells a packet that was sent twice from the next one of a robot at rest.
#[derive(Debug, Clone, Default)]
pub(crate) struct Duplicates {
    last: Vec<u8>,
    last_ns: u64,
    /// When the last packets came, duplicates included.
    arrivals: VecDeque<u64>,
    count: u64,
}

impl Duplicates {
    /// Whether the data of a status packet, read at `now_ns`, is the packet before once more: a robot that moves sends no two equal
    /// packets, and one at rest sends them a cycle apart.
    pub(crate) fn is_duplicate(&mut self, data: &[u8], now_ns: u64) -> bool {
        if self.arrivals.len() == PACE_PACKETS {
            self.arrivals.pop_front();
        }
        self.arrivals.push_back(now_ns);
        if data == self.last && (is_moving(data) || self.comes_too_soon(now_ns)) {
            self.count += 1;
            return true;
        }
        self.last.clear();
        self.last.extend_from_slice(data);
        self.last_ns = now_ns;
        false
    }

    fn comes_too_soon(&self, now_ns: u64) -> bool {
        let first_ns = self.arrivals.front().copied().unwrap_or(now_ns);
        let is_doubled = self.arrivals.len() == PACE_PACKETS && DOUBLED_NS.contains(&now_ns.saturating_sub(first_ns));
        is_doubled && now_ns.saturating_sub(self.last_ns) < CLOSE_NS
    }

    /// Packets that came twice.
    pub(crate) fn count(&self) -> u64 {
        self.count
    }
}

fn is_moving(data: &[u8]) -> bool {
    Sip::decode(data).is_ok_and(|sip| i32::from(sip.left_velocity).abs() + i32::from(sip.right_velocity).abs() >= MOVING)
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: u64 = 1_000_000;

    /// Feeds packets of a robot at rest (content, arrival in ms) and returns how many are duplicates.
    fn at_rest(packets: impl IntoIterator<Item = (u8, u64)>) -> u64 {
        let mut duplicates = Duplicates::default();
        for (content, at_ms) in packets {
            duplicates.is_duplicate(&[content], (1_000_000 + at_ms) * MS);
        }
        duplicates.count()
    }

    #[test]
    fn a_moving_robot_sends_no_two_equal_packets() {
        let mut data = [0; 20];
        (data[0], data[7]) = (0x32, 79);
        let mut duplicates = Duplicates::default();
        assert_eq!([0, 0, 0].map(|at_ns| duplicates.is_duplicate(&data, at_ns)), [false, true, true]);
        data[1] = 4;
        assert!(!duplicates.is_duplicate(&data, 0));
    }

    #[test]
    fn of_a_robot_at_rest_the_pace_tells() {
        let found = at_rest((0..100).flat_map(|k| [(k, 100 * u64::from(k)); 2]));
        assert!((91..=93).contains(&found), "{found}: all but those before the pace is known");
        let found = at_rest((0..100).flat_map(|k| [(k, 100 * u64::from(k)), (k, 100 * u64::from(k) + 5)]));
        assert!((91..=93).contains(&found), "{found}");
    }

    #[test]
    fn the_equal_packets_of_a_robot_at_rest_all_count() {
        assert_eq!(at_rest((0..100).map(|k| (7, 100 * k))), 0);
        assert_eq!(at_rest((0..100).map(|k| (7, 100 * k + 16 * (k % 2)))), 0, "the latency of a USB adapter");
        for together in [5, 10, 25, 100] {
            assert_eq!(at_rest((0..200).map(|k| (7, 100 * together * (k / together)))), 0, "{together} at a time");
        }
    }
}
