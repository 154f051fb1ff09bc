//! `control/…`: requests of a viewer to a replay, and time in a simulated world.

use crate::Invalid;
use crate::layout::plain;
use crate::service::{at_most, within};

plain! {
    /// The requested state of playback. The newest message holds.
    ///
    /// ```
    /// use stillmap_messages::{Payload, PlaybackControl};
    ///
    /// let twice_as_fast = PlaybackControl { speed: 2.0, ..PlaybackControl::default() };
    /// assert_eq!(twice_as_fast.validate(), Ok(()));
    /// ```
    pub struct PlaybackControl {
        /// Speed relative to the drive. It has no effect on a replay in lockstep.
        pub speed: f64,
        /// 1 to pause, 0 to continue.
        pub paused: u32,
        /// Always 0.
        pub reserved: u32,
    }
}

plain! {
    /// Time in a simulated world, which may lag behind the clock of the deployment.
    pub struct SimulatedTime {
        /// Time in the world, ns since the Unix epoch.
        pub now_ns: u64,
        /// Time on the clock of the deployment when it was that.
        pub since_ns: u64,
        /// 1 when the world's time runs with the clock since then, 0 when it stands until the next message.
        pub runs: u32,
        /// Always 0.
        pub reserved: u32,
    }
}

impl SimulatedTime {
    /// Time in the world when the clock of the deployment shows `clock_ns`.
    ///
    /// ```
    /// use stillmap_messages::SimulatedTime;
    ///
    /// let stands = SimulatedTime { now_ns: 100, since_ns: 150, ..SimulatedTime::default() };
    /// assert_eq!(stands.at(170), 100);
    /// assert_eq!(SimulatedTime { runs: 1, ..stands }.at(170), 120);
    /// ```
    #[must_use]
    pub fn at(&self, clock_ns: u64) -> u64 {
        let passed_ns = if self.runs == 1 { clock_ns.saturating_sub(self.since_ns) } else { 0 };
        self.now_ns.saturating_add(passed_ns)
    }

    pub(crate) fn check(&self) -> Result<(), Invalid> {
        at_most("runs", self.runs, 1, "0 or 1")
    }
}

impl PlaybackControl {
    /// Lowest speed.
    pub const SLOWEST: f64 = 0.1;
    /// Highest speed.
    pub const FASTEST: f64 = 100.0;
    /// Counter of playback's heartbeat: 1 while it is paused.
    pub const PAUSED: &'static str = "paused";
    /// Counter of playback's heartbeat: its speed in percent of the drive's; absent in lockstep.
    pub const PERCENT: &'static str = "percent of the drive's pace";
}

impl PlaybackControl {
    pub(crate) fn check(&self) -> Result<(), Invalid> {
        within("speed", self.speed, Self::SLOWEST, Self::FASTEST, "0.1 to 100")?;
        at_most("paused", self.paused, 1, "0 or 1")
    }
}
