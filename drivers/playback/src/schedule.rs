//! Live: when a message of the log is due.

/// Lays the log's time over the deployment's clock.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Schedule {
    /// On the deployment's clock, ns.
    started_ns: u64,
    /// On the log's time line, ns.
    first_stamp_ns: u64,
}

impl Schedule {
    /// The message with the stamp `first_stamp_ns` is due at `now_ns` of the deployment's clock.
    #[must_use]
    pub fn new(now_ns: u64, first_stamp_ns: u64) -> Self {
        Self { started_ns: now_ns, first_stamp_ns }
    }

    /// Time on the deployment's clock until a message is due; 0 when it is.
    #[must_use]
    pub fn due_in_ns(&self, now_ns: u64, stamp_ns: u64) -> u64 {
        let due_ns = self.started_ns.saturating_add(stamp_ns.saturating_sub(self.first_stamp_ns));
        due_ns.saturating_sub(now_ns)
    }

    /// For the next incarnation.
    #[must_use]
    pub fn to_bytes(self) -> Vec<u8> {
        [self.started_ns.to_le_bytes(), self.first_stamp_ns.to_le_bytes()].concat()
    }

    /// From an earlier one.
    #[must_use]
    pub fn from_bytes(bytes: &[u8]) -> Option<Self> {
        let (started, rest) = bytes.split_first_chunk()?;
        let (first, []) = rest.split_first_chunk()? else { return None };
        Some(Self { started_ns: u64::from_le_bytes(*started), first_stamp_ns: u64::from_le_bytes(*first) })
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
    fn a_restart_keeps_the_schedule() {
        let schedule = Schedule::new(123, 456);
        assert_eq!(Schedule::from_bytes(&schedule.to_bytes()), Some(schedule));
        assert_eq!(Schedule::from_bytes(&[0; 15]), None);
        assert_eq!(Schedule::from_bytes(&[0; 17]), None);
    }
}
