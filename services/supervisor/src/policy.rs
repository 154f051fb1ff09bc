//! When a process that died may start again, and how patient the supervisor is.

use std::collections::VecDeque;
use std::time::Duration;

/// The supervisor's patience; every time is a span.
#[derive(Debug, Clone, PartialEq)]
pub struct Policy {
    /// From a start to the first heartbeat.
    pub startup_deadline: Duration,
    /// From one heartbeat to the next; a process that is silent for longer hangs.
    pub heartbeat_timeout: Duration,
    /// Most restarts of one process within [`Policy::within`].
    pub restarts: u32,
    /// The window in which restarts are counted.
    pub within: Duration,
    /// From a death to the first restart.
    pub backoff_first: Duration,
    /// Longest time from a death to a restart.
    pub backoff_last: Duration,
    /// From the wish that a process stops to the next stronger means.
    pub stop_deadline: Duration,
}

/// The restarts of one process: grants at most [`Policy::restarts`] in any span of [`Policy::within`].
#[derive(Debug, Clone)]
pub struct Restarts {
    recent: VecDeque<Duration>,
    jitter: Jitter,
}

impl Restarts {
    /// No restarts yet; `seed` decides the jitter of the delays.
    #[must_use]
    pub fn new(seed: u64) -> Self {
        Self { recent: VecDeque::new(), jitter: Jitter(seed) }
    }

    /// Forgets the restarts so far: the whole budget is there again.
    pub(crate) fn clear(&mut self) {
        self.recent.clear();
    }

    /// The time of the next restart, or `None` when the budget is spent.
    ///
    /// The delay doubles with every restart that still counts, and varies by a quarter, so that processes that died of one
    /// cause do not come back in step.
    pub fn grant(&mut self, policy: &Policy, now: Duration) -> Option<Duration> {
        while self.recent.front().is_some_and(|at| *at + policy.within <= now) {
            self.recent.pop_front();
        }
        if self.recent.len() >= policy.restarts as usize {
            return None;
        }
        let doublings = self.recent.len().min(31) as u32;
        let delay = policy.backoff_first.saturating_mul(1 << doublings).min(policy.backoff_last);
        let at = now + delay.mul_f64(self.jitter.next(0.75, 1.25));
        self.recent.push_back(at);
        Some(at)
    }
}

/// Even numbers from a seed (SplitMix64): the core draws no randomness of its own.
#[derive(Debug, Clone)]
struct Jitter(u64);

impl Jitter {
    fn next(&mut self, low: f64, high: f64) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^= z >> 31;
        low + (high - low) * (z >> 11) as f64 / (1u64 << 53) as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn policy() -> Policy {
        Policy {
            startup_deadline: Duration::from_secs(5),
            heartbeat_timeout: Duration::from_secs(2),
            restarts: 5,
            within: Duration::from_secs(30),
            backoff_first: Duration::from_millis(20),
            backoff_last: Duration::from_millis(100),
            stop_deadline: Duration::from_secs(3),
        }
    }

    #[test]
    fn delays_double_up_to_the_last_and_vary_by_a_quarter() {
        let (policy, mut restarts) = (policy(), Restarts::new(1));
        for expected_ms in [20.0, 40.0, 80.0, 100.0, 100.0] {
            let delay_ms = restarts.grant(&policy, Duration::ZERO).unwrap().as_secs_f64() * 1e3;
            assert!((0.75 * expected_ms..=1.25 * expected_ms).contains(&delay_ms), "{delay_ms} ms, expected about {expected_ms}");
        }
        assert_eq!(restarts.grant(&policy, Duration::ZERO), None);
    }

    #[test]
    fn a_restart_that_is_long_ago_counts_no_more() {
        let (policy, mut restarts) = (policy(), Restarts::new(1));
        while restarts.grant(&policy, Duration::ZERO).is_some() {}
        assert_eq!(restarts.grant(&policy, Duration::from_secs(30)), None, "the restarts came a little after the deaths");
        let at = restarts.grant(&policy, Duration::from_secs(31)).unwrap();
        assert!(at <= Duration::from_millis(31_025), "the first delay again, found {at:?}");
    }

    #[test]
    fn seeds_differ() {
        let policy = policy();
        assert_ne!(Restarts::new(1).grant(&policy, Duration::ZERO), Restarts::new(2).grant(&policy, Duration::ZERO));
    }
}
