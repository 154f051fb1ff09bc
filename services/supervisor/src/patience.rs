//! The clock that deadlines are measured by: it runs only while the supervisor looks.

use crate::events::Standstill;
use rustix::time::{ClockId, clock_gettime};
use std::time::Duration;

/// Most time that passes between two looks. A round waits for 0.1 s at most and then works for some ms; a supervisor that was stopped,
/// frozen with its container or starved of its processor has not looked for longer, and in that time no process could be heard.
const LONGEST_ROUND: Duration = Duration::from_millis(300);
/// A standstill that is told, and after which each process has its whole time again.
const STANDSTILL: Duration = Duration::from_secs(1);

/// Times of two clocks of the kernel.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct KernelTime {
    /// Runs while the computer does (`CLOCK_MONOTONIC`).
    pub(crate) awake: Duration,
    /// Runs while the computer is suspended, too (`CLOCK_BOOTTIME`).
    pub(crate) since_boot: Duration,
}

impl KernelTime {
    pub(crate) fn now() -> Self {
        let read = |clock| {
            let time = clock_gettime(clock);
            Duration::new(time.tv_sec.try_into().unwrap_or_default(), time.tv_nsec.try_into().unwrap_or_default())
        };
        Self { awake: read(ClockId::Monotonic), since_boot: read(ClockId::Boottime) }
    }
}

/// The clock.
#[derive(Debug, Clone)]
pub(crate) struct LookClock {
    now: Duration,
    looked: KernelTime,
}

impl LookClock {
    pub(crate) fn start(at: KernelTime) -> Self {
        Self { now: Duration::ZERO, looked: at }
    }

    /// The time of the last look.
    pub(crate) fn now(&self) -> Duration {
        self.now
    }

    /// The supervisor looks; whether it has stood still before.
    pub(crate) fn look(&mut self, at: KernelTime) -> Option<Standstill> {
        let awake = at.awake.saturating_sub(self.looked.awake);
        let suspended = at.since_boot.saturating_sub(self.looked.since_boot).saturating_sub(awake);
        self.looked = at;
        self.now += awake.min(LONGEST_ROUND);
        if suspended >= STANDSTILL {
            Some(Standstill::Suspended(suspended))
        } else {
            (awake >= STANDSTILL).then_some(Standstill::Stopped(awake))
        }
    }

    /// The time since the last look has not passed.
    pub(crate) fn skip(&mut self, at: KernelTime) {
        self.looked = at;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(awake_ms: u64, suspended_ms: u64) -> KernelTime {
        let offset = Duration::from_secs(7_000);
        KernelTime {
            awake: offset + Duration::from_millis(awake_ms),
            since_boot: offset * 2 + Duration::from_millis(awake_ms + suspended_ms),
        }
    }

    fn ms(ms: u64) -> Duration {
        Duration::from_millis(ms)
    }

    #[test]
    fn it_runs_with_the_kernels_while_the_supervisor_looks() {
        let mut clock = LookClock::start(at(0, 0));
        for step in 1..=50 {
            assert_eq!(clock.look(at(step * 100, 0)), None);
            assert_eq!(clock.now(), ms(step * 100));
        }
    }

    #[test]
    fn a_standstill_is_told_and_does_not_pass() {
        let mut clock = LookClock::start(at(0, 0));
        assert_eq!(clock.look(at(12_000, 0)), Some(Standstill::Stopped(ms(12_000))));
        assert_eq!(clock.now(), LONGEST_ROUND);
        assert_eq!(clock.look(at(12_100, 0)), None);
        assert_eq!(clock.now(), LONGEST_ROUND + ms(100));
    }

    #[test]
    fn a_suspended_computer_is_told_apart() {
        let mut clock = LookClock::start(at(0, 0));
        assert_eq!(clock.look(at(100, 3_600_000)), Some(Standstill::Suspended(ms(3_600_000))));
        assert_eq!(clock.now(), ms(100));
        assert_eq!(clock.look(at(200, 3_600_000)), None);
    }

    #[test]
    fn a_slow_computer_is_no_standstill_and_gives_more_time() {
        let mut clock = LookClock::start(at(0, 0));
        assert_eq!(clock.look(at(900, 0)), None);
        assert_eq!(clock.now(), LONGEST_ROUND);
    }

    #[test]
    fn time_that_is_skipped_does_not_pass() {
        let mut clock = LookClock::start(at(0, 0));
        clock.skip(at(60_000, 0));
        assert_eq!(clock.look(at(60_050, 0)), None);
        assert_eq!(clock.now(), ms(50));
    }
}
