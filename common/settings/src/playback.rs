//! `[playback]`: a log in place of the robot.

use std::path::PathBuf;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::bounded::bounded;

bounded! {
    /// Scans that playback in lockstep publishes ahead of the slowest consumer.
    Window: u32 in 1..=256, "scans", default 256;
    /// Time from the start of a log.
    LogTime: f64 in 0.0..=1e9, "s", default 0.0;
}

/// What a restart relies on is asserted in the registry, for the largest window.
const _: () = assert!(Window::MAX.0 == messages::Replay::SCANS.window);

/// `[playback]`: a log in place of the robot.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields, expecting = "a table")]
pub struct Playback {
    /// Log that is replayed, relative to the settings file.
    #[serde(deserialize_with = "crate::text::path")]
    #[schemars(extend("x-form" = "path"))]
    pub log: PathBuf,
    /// Start of the span that is played, from the start of the log. The map begins empty there.
    pub from_s: LogTime,
    /// End of that span, from the start of the log. The default is the end of the log.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub to_s: Option<LogTime>,
    /// Number of scans that playback publishes ahead of the slowest consumer, with the pace "lockstep".
    pub window: Window,
    /// Whether the recorded camera motion is published, in place of that of a process "sbs".
    pub camera_motion: bool,
}

impl Default for Playback {
    fn default() -> Self {
        Self { log: PathBuf::from("drive.mcap"), from_s: LogTime::default(), to_s: None, window: Window::default(), camera_motion: false }
    }
}
