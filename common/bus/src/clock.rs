//! The deployment's clock: sensor time for drivers, faster than the wall when a simulation runs faster.

use std::time::Duration;

use rustix::time::{ClockId, clock_gettime};

/// Maps the machine's monotonic clock to nanoseconds since the Unix epoch, at a given speed. The same in every process of a
/// deployment, so that stamps of several drivers agree; it never runs backwards.
///
/// ```
/// use stillmap_bus::DeploymentClock;
///
/// // A simulation that runs ten times faster than real time.
/// let clock = DeploymentClock::start(10.0);
/// let stamp_ns = clock.now_ns();
/// assert!(clock.now_ns() >= stamp_ns);
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DeploymentClock {
    /// The monotonic clock when the deployment started, ns.
    pub(crate) started_monotonic_ns: u64,
    /// The wall clock at the same moment, ns since the Unix epoch.
    pub(crate) started_real_ns: u64,
    speed: f64,
}

impl DeploymentClock {
    /// A clock that starts now. `speed` is kept within 0.001 to 1000.
    #[must_use]
    pub fn start(speed: f64) -> Self {
        Self::from_parts(nanoseconds(ClockId::Monotonic), nanoseconds(ClockId::Realtime), speed)
    }

    /// The same clock, set to this time at its start if it would be earlier: in a run that is resumed, time does not run backwards,
    /// whatever became of the wall clock since.
    pub(crate) fn not_before(self, least_ns: u64) -> Self {
        Self { started_real_ns: self.started_real_ns.max(least_ns), ..self }
    }

    pub(crate) fn from_parts(started_monotonic_ns: u64, started_real_ns: u64, speed: f64) -> Self {
        let speed = if speed.is_finite() { speed.clamp(0.001, 1000.0) } else { 1.0 };
        Self { started_monotonic_ns, started_real_ns, speed }
    }

    /// Deployment seconds that pass in a second of the wall clock.
    #[must_use]
    pub fn speed(&self) -> f64 {
        self.speed
    }

    /// Now, ns since the Unix epoch in deployment time.
    #[must_use]
    pub fn now_ns(&self) -> u64 {
        self.at(nanoseconds(ClockId::Monotonic))
    }

    /// Since the deployment started, s of deployment time.
    #[must_use]
    pub fn elapsed_s(&self) -> f64 {
        self.now_ns().saturating_sub(self.started_real_ns) as f64 * 1e-9
    }

    /// Wall time since a stamp of this clock; nothing for one that is still to come.
    pub(crate) fn since(&self, stamp_ns: u64) -> Duration {
        Duration::from_nanos((self.now_ns().saturating_sub(stamp_ns) as f64 / self.speed) as u64)
    }

    fn at(&self, monotonic_ns: u64) -> u64 {
        let elapsed = monotonic_ns.saturating_sub(self.started_monotonic_ns) as f64 * self.speed;
        self.started_real_ns + elapsed as u64
    }
}

fn nanoseconds(clock: ClockId) -> u64 {
    let now = clock_gettime(clock);
    (now.tv_sec.unsigned_abs()) * 1_000_000_000 + now.tv_nsec.unsigned_abs()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_fast_clock_runs_as_many_times_faster() {
        let clock = DeploymentClock::from_parts(1_000, 5_000_000_000, 10.0);
        assert_eq!(clock.at(1_000), 5_000_000_000);
        assert_eq!(clock.at(1_000 + 2_000_000_000), 25_000_000_000);
        assert_eq!(clock.at(0), 5_000_000_000, "before the start it stands");
    }

    #[test]
    fn the_clock_of_a_resumed_run_is_set_forward_and_never_back() {
        let clock = DeploymentClock::from_parts(1_000, 5_000, 2.0);
        assert_eq!(clock.not_before(7_000).at(1_010), 7_020);
        assert_eq!(clock.not_before(4_000), clock);
    }

    #[test]
    fn a_speed_that_is_no_speed_is_one() {
        assert!((DeploymentClock::start(f64::NAN).speed() - 1.0).abs() < f64::EPSILON);
        assert!((DeploymentClock::start(0.0).speed() - 0.001).abs() < f64::EPSILON);
    }
}
