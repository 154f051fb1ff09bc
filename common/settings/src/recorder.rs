//! `[recorder]`: the log of a run.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::bounded::bounded;
use crate::text::FileName;

bounded! {
    /// Time between two flushes of the log.
    FlushInterval: f64 in 0.05..=60.0, "s", default 1.0;
}

/// `[recorder]`: the log of a run.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields, expecting = "a table")]
pub struct Recorder {
    /// Name of the log in the folder `out`. After 1024 chunks it goes on in the next file (`drive.2.mcap`, …): 17 minutes at a flush
    /// every second, less where a second is more than a megabyte.
    pub file: FileName,
    /// Time between two flushes: what a killed recorder may lose.
    pub flush_s: FlushInterval,
    /// Whether the pictures of the camera are recorded, too: 17 MB a minute at 160 × 120 in grey and 15 Hz, 280 MB at 640 × 480.
    pub pictures: bool,
}

impl Default for Recorder {
    fn default() -> Self {
        Self { file: FileName::literal("drive.mcap"), flush_s: FlushInterval::default(), pictures: true }
    }
}
