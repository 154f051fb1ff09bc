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
}

/// `[supervisor]`: how processes are watched and restarted.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields, expecting = "a table")]
pub struct Supervisor {
    /// A process without a heartbeat this long after its start is killed and started again.
    pub startup_deadline_s: StartupDeadline,
    /// A process silent for this long is taken to hang: killed and started again.
    pub heartbeat_timeout_s: HeartbeatTimeout,
    /// More restarts than this within `within_s`, and the process has failed for good.
    pub restarts: RestartBudget,
    /// The time in which restarts are counted.
    pub within_s: RestartPeriod,
    /// Delay before the first restart; it doubles with each further one.
    pub backoff_first_s: FirstBackoff,
    /// Longest delay before a restart.
    pub backoff_last_s: LastBackoff,
    /// A process that has not stopped this long after it was asked to is killed.
    pub stop_deadline_s: StopDeadline,
}
