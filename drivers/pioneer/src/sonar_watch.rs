//! Which sonars have fallen silent: a robot tells of those that fire, never of those that do not.

use psos::RawReading;

/// Sonar numbers that are watched: four arrays of eight, as many as any of the robots has.
const MOST_SONARS: usize = 32;

/// A sonar that fired once and then is silent for this long is said, if the others continued.
const SILENT_NS: u64 = 5_000_000_000;

/// Rounds of the ring that others must have fired meanwhile: at one packet a second a ring of sixteen takes 8 s for a round.
const ROUNDS: u64 = 4;

/// When a sonar fired last.
#[derive(Debug, Clone, Copy)]
struct Firing {
    at_ns: u64,
    /// Readings of all sonars before it.
    readings: u64,
}

/// Watches the sonars of one robot.
#[derive(Debug, Clone, Default)]
pub(crate) struct SonarWatch {
    last: [Option<Firing>; MOST_SONARS],
    readings: u64,
}

impl SonarWatch {
    /// Takes the readings of a packet.
    pub(crate) fn note(&mut self, readings: &[RawReading], now_ns: u64) {
        for reading in readings {
            self.readings += 1;
            if let Some(last) = self.last.get_mut(usize::from(reading.sonar)) {
                *last = Some(Firing { at_ns: now_ns, readings: self.readings });
            }
        }
    }

    /// Sonars that have fired and do no longer, in words; `None` when there are none.
    pub(crate) fn silent(&self, now_ns: u64) -> Option<String> {
        let known = self.last.iter().flatten().count() as u64;
        let is_silent =
            |firing: &Firing| now_ns.saturating_sub(firing.at_ns) >= SILENT_NS && self.readings - firing.readings >= ROUNDS * known;
        let silent: Vec<_> =
            (0..).zip(&self.last).filter(|(_, last)| last.as_ref().is_some_and(is_silent)).map(|(sonar, _): (u8, _)| sonar).collect();
        match silent.as_slice() {
            [] => None,
            [one] => Some(format!("sonar {one} silent")),
            [first, .., last] if silent.len() > 4 => Some(format!("{} sonars of {first} to {last} silent", silent.len())),
            some => Some(format!("sonars {} silent", some.iter().map(u8::to_string).collect::<Vec<_>>().join(", "))),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: u64 = 1_000_000;

    /// A ring of which these sonars fire for 20 s, two a packet, and those below `still` for 20 s more.
    fn silent(sonars: u8, still: u8, cycle_ms: u64) -> Option<String> {
        let mut watch = SonarWatch::default();
        for packet in 0..40_000 / cycle_ms {
            let now_ns = (100_000 + packet * cycle_ms) * MS;
            let firing = if packet * cycle_ms < 20_000 { sonars } else { still };
            let turn = |k: u64| RawReading { sonar: ((2 * packet + k) % u64::from(firing)) as u8, range: 1000 };
            watch.note(&[turn(0), turn(1)], now_ns);
        }
        watch.silent(140_000 * MS)
    }

    #[test]
    fn sonars_that_stop_are_named() {
        assert_eq!(silent(7, 6, 100).as_deref(), Some("sonar 6 silent"));
        assert_eq!(silent(8, 5, 100).as_deref(), Some("sonars 5, 6, 7 silent"));
        assert_eq!(silent(16, 8, 100).as_deref(), Some("8 sonars of 8 to 15 silent"), "an array of two");
    }

    #[test]
    fn a_ring_that_fires_is_not_silent_however_slowly() {
        assert_eq!(silent(7, 7, 100), None);
        assert_eq!(silent(16, 16, 1000), None);
    }
}
