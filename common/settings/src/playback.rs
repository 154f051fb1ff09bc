//! `[playback]`: a log in place of the robot.

use std::path::PathBuf;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::bounded::bounded;

bounded! {
    /// Scans that playback in lockstep publishes ahead of the slowest consumer.
    Window: u32 in 1..=256, "scans", default 256;
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
    /// Number of scans that playback publishes ahead of the slowest consumer, with the pace "lockstep".
    pub window: Window,
    /// Whether the recorded camera motion is published, in place of that of a process "sbs".
    pub camera_motion: bool,
}

impl Default for Playback {
    fn default() -> Self {
        Self { log: PathBuf::from("drive.mcap"), window: Window::default(), camera_motion: false }
    }
}
