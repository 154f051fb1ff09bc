//! `control/playback`: what a person who watches a replay asks of it.

use crate::Invalid;
use crate::layout::plain;
use crate::service::{at_most, within};

plain! {
    /// How playback is to go on. The newest holds.
    pub struct PlaybackControl {
        /// Times the pace of the drive; of a replay in lockstep, which has no pace, without effect.
        pub speed: f64,
        /// 1 to stand still, 0 to go on.
        pub paused: u32,
        /// Always 0.
        pub reserved: u32,
    }
}

impl PlaybackControl {
    /// The slowest that playback goes.
    pub const SLOWEST: f64 = 0.1;
    /// The fastest that playback goes.
    pub const FASTEST: f64 = 100.0;
    /// Counter of playback's heartbeat: 1 while it stands still.
    pub const PAUSED: &'static str = "paused";
    /// Counter of playback's heartbeat: its pace, in hundredths of the drive's; absent in lockstep.
    pub const PERCENT: &'static str = "percent of the drive's pace";
}

impl PlaybackControl {
    pub(crate) fn check(&self) -> Result<(), Invalid> {
        within("speed", self.speed, Self::SLOWEST, Self::FASTEST, "0.1 to 100")?;
        at_most("paused", self.paused, 1, "0 or 1")
    }
}
