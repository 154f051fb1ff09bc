//! `control/playback`: requests of a viewer to a replay.

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
