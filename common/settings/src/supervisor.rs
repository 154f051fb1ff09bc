//! `[supervisor]`: how processes are watched and restarted.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::bounded::bounded;

bounded! {
    /// Time from start to the first heartbeat.
    StartupDeadline: f64 in 0.1..=600.0, "s", default 5.0;
    /// Silence after which a process is taken to hang.
    HeartbeatTimeout: f64 in 0.5..=600.0, "s", default 2.0;
    /// Restarts allowed within a time.
    RestartBudget: u32 in 0..=1000, "", default 5;
    /// The time in which restarts are counted.
    RestartPeriod: f64 in 1.0..=86400.0, "s", default 30.0;
    /// Delay before the first restart.
    FirstBackoff: f64 in 0.001..=60.0, "s", default 0.02;
    /// Longest delay before a restart.
    LastBackoff: f64 in 0.001..=600.0, "s", default 5.0;
    /// Time to stop in before a process is killed.
    StopDeadline: f64 in 0.1..=600.0, "s", default 3.0;
    /// Time between two syncs of the disk.
    SyncInterval: f64 in 1.0..=3600.0, "s", default 10.0;
    /// Free space below which the disk counts as nearly full.
    DiskLow: f64 in 0.0..=1e9, "MB", default 500.0;
}

/// `[supervisor]`: how processes are watched and restarted.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields, expecting = "a table")]
pub struct Supervisor {
    /// Time from the start of a process to its first heartbeat. After this time without one it is killed and restarted.
    pub startup_deadline_s: StartupDeadline,
    /// Time without a heartbeat after which a process is considered hung: it is killed and restarted.
    pub heartbeat_timeout_s: HeartbeatTimeout,
    /// Number of restarts allowed within `within_s`. After more of them the process has failed for good.
    pub restarts: RestartBudget,
    /// Time in which the restarts of a process are counted.
    pub within_s: RestartPeriod,
    /// Delay before the first restart. It doubles with each further restart.
    pub backoff_first_s: FirstBackoff,
    /// Longest delay before a restart.
    pub backoff_last_s: LastBackoff,
    /// Time to stop in order. A process that takes longer is killed.
    pub stop_deadline_s: StopDeadline,
    /// Time between two syncs of the disk, in a run that can be resumed. A power cut takes at most this time of the log, with its last
    /// flush.
    pub sync_s: SyncInterval,
    /// Program with its arguments that is started at each event: a process fails or restarts, messages are lost, the disk is nearly
    /// full. The environment has the event (docs/operations.md). Without it events are only logged.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    #[schemars(length(max = 64))]
    pub on_event: Vec<String>,
    /// Free space of the disk of `out` below which the event `disk_low` is reported.
    pub disk_low_mb: DiskLow,
}
