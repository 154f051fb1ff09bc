//! Delivery of services: how much history they have, and how far the consumers of a stream may be apart.

/// History, buffer and number of ports of a service.
///
/// Every count of processes includes at least two in reserve: tools join a running deployment, and a killed process occupies its port
/// until the supervisor has cleaned up.
///
/// ```
/// use stillmap_messages::{Payload, Qos, SonarScan};
///
/// assert_eq!(SonarScan::SERVICE.qos, Qos::STREAM);
/// assert_eq!(Qos::STREAM.history, 512);
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Qos {
    /// Messages that a late or restarted subscriber still receives.
    pub history: usize,
    /// Messages that wait for a subscriber before the oldest is dropped.
    pub buffer: usize,
    /// Most processes that publish at once.
    pub publishers: usize,
    /// Most processes that subscribe at once.
    pub subscribers: usize,
}

impl Qos {
    /// One sender, and no message may be lost.
    pub const STREAM: Qos = Qos { history: 512, buffer: 1024, publishers: 3, subscribers: 12 };
    /// Pictures of one sender, and none may be lost. Memory limits the history: at 640 × 480 in RGB the buffer is 37 MB.
    pub const PICTURES: Qos = Qos { history: 24, buffer: 40, publishers: 3, subscribers: 8 };
    /// Pictures for display only.
    pub const PREVIEW: Qos = Qos { history: 1, buffer: 8, publishers: 3, subscribers: 8 };
    /// One sender, and only the newest message matters: a late reader receives that.
    pub const NEWEST: Qos = Qos { history: 1, buffer: 4, publishers: 3, subscribers: 12 };
    /// Every process sends a few messages per second.
    pub const REPORTS: Qos = Qos { history: 1, buffer: 16, publishers: 32, subscribers: 12 };
}

/// How playback sends a stream, and how far its consumers may fall behind. All of these are counts of messages.
///
/// The history of a stream is lost with its sender, and a consumer that is killed resumes from a checkpoint that lies before what
/// it has answered. So a restarted playback sends again what the history held, and [`Replay::resent`] of that must cover the
/// lockstep window and a consumer's checkpoint interval. This is asserted at compile time for every service of the registry.
///
/// ```
/// use stillmap_messages::{CameraFrame, Pictures, Replay};
///
/// assert_eq!(CameraFrame::SERVICE.replay, Some(Replay::FRAMES));
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Replay {
    /// Most messages that are sent ahead of the slowest consumer in lockstep.
    pub window: u32,
    /// A consumer saves its state at least after so many messages.
    pub checkpoint: u64,
    /// Playback saves how far it has come once in so many messages.
    pub reserve: u64,
    /// Messages that a restarted playback sends beyond what it may have sent before, while a consumer has not reported its
    /// progress: the first of them is new to every consumer, so that each of them answers.
    pub lead: u32,
}

impl Replay {
    /// Scans, and what is as frequent as they are.
    pub const SCANS: Replay = Replay { window: 256, checkpoint: 64, reserve: 64, lead: 64 };
    /// Pictures.
    pub const FRAMES: Replay = Replay { window: 8, checkpoint: 8, reserve: 4, lead: 4 };

    /// Messages before the last saved place that a restarted playback sends again. With those that may have been sent after the
    /// place was saved, and with the lead, they are as many as the history holds.
    ///
    /// ```
    /// use stillmap_messages::{Payload, Replay, SonarScan};
    ///
    /// let replay = Replay::SCANS;
    /// assert_eq!(replay.resent(SonarScan::SERVICE.qos.history), 512 - 64 - 63);
    /// assert!(u64::from(replay.window) + replay.checkpoint <= replay.resent(512));
    /// ```
    #[must_use]
    pub const fn resent(&self, history: usize) -> u64 {
        history as u64 - self.lead as u64 - (self.reserve - 1)
    }
}
