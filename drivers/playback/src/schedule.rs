//! Live: when a message of the log is due.

/// Maps the time of the log to the deployment's clock.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Schedule {
    /// On the deployment's clock, ns.
    anchor_ns: u64,
    /// On the log's time line, ns.
    anchor_stamp_ns: u64,
    /// Nanoseconds of the log per nanosecond of the deployment's clock; 0 while it is paused.
    rate: f64,
}

impl Schedule {
    /// The message with the stamp `first_stamp_ns` is due at `now_ns` of the deployment's clock, and the log runs at its speed.
    #[must_use]
    pub fn new(now_ns: u64, first_stamp_ns: u64) -> Self {
        Self { anchor_ns: now_ns, anchor_stamp_ns: first_stamp_ns, rate: 1.0 }
    }

    /// From `now_ns` on, the log continues `rate` times as fast as the deployment's clock; 0 pauses it.
    #[must_use]
    pub fn paced(self, now_ns: u64, rate: f64) -> Self {
        let passed_ns = now_ns.saturating_sub(self.anchor_ns) as f64 * self.rate;
        let rate = if rate.is_finite() { rate.max(0.0) } else { 1.0 };
        Self { anchor_ns: now_ns, anchor_stamp_ns: self.anchor_stamp_ns.saturating_add(passed_ns as u64), rate }
    }

    /// Nanoseconds of the log per nanosecond of the deployment's clock; 0 while it is paused.
    #[must_use]
    pub fn rate(&self) -> f64 {
        self.rate
    }

    /// Time on the deployment's clock until a message is due: 0 when it is due, `u64::MAX` when it never is.
    #[must_use]
    pub fn due_in_ns(&self, now_ns: u64, stamp_ns: u64) -> u64 {
        let ahead_ns = stamp_ns.saturating_sub(self.anchor_stamp_ns);
        // A message that was due when the log was paused is still sent.
        if ahead_ns == 0 {
            return self.anchor_ns.saturating_sub(now_ns);
        }
        if self.rate <= 0.0 {
            return u64::MAX;
        }
        let after_ns = (ahead_ns as f64 / self.rate) as u64;
        self.anchor_ns.saturating_add(after_ns).saturating_sub(now_ns)
    }

    /// For the next incarnation.
    #[must_use]
    pub fn to_bytes(self) -> Vec<u8> {
        [self.anchor_ns, self.anchor_stamp_ns, self.rate.to_bits()].map(u64::to_le_bytes).concat()
    }

    /// From an earlier one.
    #[must_use]
    pub fn from_bytes(bytes: &[u8]) -> Option<Self> {
        let (numbers, []) = bytes.as_chunks::<8>() else { return None };
        let [anchor_ns, anchor_stamp_ns, rate] = numbers else { return None };
        let rate = f64::from_le_bytes(*rate);
        let is_valid = rate.is_finite() && rate >= 0.0;
        is_valid.then(|| Self { anchor_ns: u64::from_le_bytes(*anchor_ns), anchor_stamp_ns: u64::from_le_bytes(*anchor_stamp_ns), rate })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn messages_keep_their_distances() {
        let schedule = Schedule::new(1_000_000, 500);
        assert_eq!(schedule.due_in_ns(1_000_000, 500), 0);
        assert_eq!(schedule.due_in_ns(1_000_000, 800), 300);
        assert_eq!(schedule.due_in_ns(1_000_299, 800), 1);
        assert_eq!(schedule.due_in_ns(2_000_000, 800), 0, "late ones come at once");
        assert_eq!(schedule.due_in_ns(1_000_000, 0), 0, "a stamp before the first is not waited for");
        assert_eq!(schedule.due_in_ns(0, u64::MAX), u64::MAX);
    }

    #[test]
    fn a_pause_delays_what_was_not_due() {
        let paused = Schedule::new(1_000, 0).paced(3_000, 0.0);
        assert_eq!((paused.due_in_ns(9_000, 2_000), paused.due_in_ns(9_000, 2_001)), (0, u64::MAX));
        let fast = paused.paced(10_000, 4.0);
        assert_eq!((fast.due_in_ns(10_000, 2_400), fast.due_in_ns(10_090, 2_400)), (100, 10));
        let slow = fast.paced(10_100, 0.5);
        assert_eq!(slow.due_in_ns(10_100, 2_500), 200);
        assert_eq!(Schedule::from_bytes(&slow.to_bytes()), Some(slow), "a restart keeps the pace");
        assert_eq!(slow.paced(0, f64::NAN).rate(), 1.0);
    }

    #[test]
    fn a_restart_keeps_the_schedule() {
        let schedule = Schedule::new(123, 456);
        assert_eq!(Schedule::from_bytes(&schedule.to_bytes()), Some(schedule));
        assert_eq!(Schedule::from_bytes(&[0; 23]), None);
        assert_eq!(Schedule::from_bytes(&[0; 25]), None);
        assert_eq!(Schedule::from_bytes(&[0xff; 24]), None, "a pace that is no number");
    }
}
