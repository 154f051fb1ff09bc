//! `[recorder]`: the log of a run.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::bounded::bounded;
use crate::text::FileName;

bounded! {
    /// Time between two flushes of the log.
    FlushInterval: f64 in 0.05..=60.0, "s", default 1.0;
    /// Space that a log may take.
    LogSpace: f64 in 64.0..=1e9, "MB";
    /// Space that stays free.
    FreeSpace: f64 in 1.0..=1e9, "MB";
}

/// `[recorder]`: the log of a run.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields, expecting = "a table")]
pub struct Recorder {
    /// Name of the log in the folder `out`. After 1024 chunks it continues in the next file (`drive.2.mcap` and so on): after 17
    /// minutes with a flush every second, and sooner where a second takes more than a megabyte.
    pub file: FileName,
    /// Time between two flushes. A killed recorder loses at most this time.
    pub flush_s: FlushInterval,
    /// Whether the pictures of the camera are recorded. In grey at 15 Hz they take 17 MB per minute at 160 × 120, 280 MB at 640 × 480.
    pub pictures: bool,
    /// Space that the log may take. Old parts are removed. One is kept if a file of its name with `.keep` behind it is there. The default
    /// is no limit.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub keep_mb: Option<LogSpace>,
    /// Space of the disk that the log leaves free, by removing old parts. The default is none.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub leave_free_mb: Option<FreeSpace>,
}

impl Default for Recorder {
    fn default() -> Self {
        Self {
            file: FileName::literal("drive.mcap"),
            flush_s: FlushInterval::default(),
            pictures: true,
            keep_mb: None,
            leave_free_mb: None,
        }
    }
}
