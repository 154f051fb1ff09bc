//! How long messages were on their way, lately.

use std::time::Duration;

/// Classes of latency: four to an octave, from 1 µs on; the last takes everything above 26 s.
const CLASSES: usize = 100;
/// Messages after which older ones count half.
const MEMORY: u32 = 4096;
/// Older than this, a message is not on its way: it was recorded, or belongs to a history that a reader has just been given.
const LONGEST: Duration = Duration::from_secs(60);

/// A histogram of latencies that forgets.
#[derive(Debug, Clone)]
pub(crate) struct Latencies {
    counts: [u32; CLASSES],
    total: u32,
}

impl Latencies {
    pub(crate) fn new() -> Self {
        Self { counts: [0; CLASSES], total: 0 }
    }

    /// Takes a message that arrived so long after what it tells of, in wall time.
    pub(crate) fn take(&mut self, latency: Duration) {
        if latency > LONGEST {
            return;
        }
        if self.total >= MEMORY {
            self.counts.iter_mut().for_each(|count| *count /= 2);
            self.total = self.counts.iter().sum();
        }
        if let Some(count) = self.counts.get_mut(class(latency)) {
            *count += 1;
            self.total += 1;
        }
    }

    /// The latency that this share of messages stays within, µs, to a fifth of itself; 0 without messages.
    pub(crate) fn within_us(&self, share: f64) -> u32 {
        let wanted = (f64::from(self.total) * share).ceil() as u32;
        let mut counted = 0;
        for (class, count) in self.counts.iter().enumerate() {
            counted += count;
            if *count > 0 && counted >= wanted {
                return 2_f64.powf((class as f64 + 0.5) / 4.0).round() as u32;
            }
        }
        0
    }
}

fn class(latency: Duration) -> usize {
    let us = latency.as_secs_f64() * 1e6;
    ((us.max(1.0).log2() * 4.0) as usize).min(CLASSES - 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn median_and_tail_are_those_of_the_messages() {
        let mut latencies = Latencies::new();
        assert_eq!(latencies.within_us(0.5), 0);
        (0..990).for_each(|_| latencies.take(Duration::from_micros(100)));
        (0..10).for_each(|_| latencies.take(Duration::from_millis(50)));
        let near = |found: u32, expected: f64| assert!((f64::from(found) / expected - 1.0).abs() < 0.2, "{found}, expected {expected}");
        near(latencies.within_us(0.5), 100.0);
        near(latencies.within_us(0.99), 100.0);
        near(latencies.within_us(0.995), 50_000.0);
    }

    #[test]
    fn the_old_is_forgotten_and_the_recorded_not_counted() {
        let mut latencies = Latencies::new();
        latencies.take(Duration::from_secs(3600));
        assert_eq!(latencies.within_us(1.0), 0);
        (0..MEMORY).for_each(|_| latencies.take(Duration::from_secs(1)));
        (0..3 * MEMORY).for_each(|_| latencies.take(Duration::ZERO));
        assert_eq!(latencies.within_us(0.5), 1);
        assert!(latencies.total <= MEMORY);
    }
}
