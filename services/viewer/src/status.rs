//! The state of the processes, as the page receives it.

use std::collections::BTreeMap;

use messages::{DeploymentStatus, ProcessState, ProcessStatus};
use serde::Serialize;

/// The state of the processes of a deployment.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(tag = "kind", rename = "status")]
pub(crate) struct Status {
    deployment: String,
    uptime_s: f64,
    ending: bool,
    processes: Vec<ProcessView>,
}

#[derive(Debug, Clone, PartialEq, Serialize)]
struct ProcessView {
    name: String,
    state: &'static str,
    pid: u32,
    restarts: u32,
    received_per_s: f64,
    sent_per_s: f64,
    lost: u64,
    refused: u64,
    /// Share of one core.
    cpu: f64,
    resident_bytes: u64,
    note: String,
    counters: BTreeMap<String, u64>,
}

impl From<&DeploymentStatus> for Status {
    fn from(status: &DeploymentStatus) -> Self {
        let processes = status.processes.iter().take(status.count as usize);
        Self {
            deployment: status.deployment.to_string(),
            uptime_s: status.uptime_ms as f64 * 1e-3,
            ending: status.ending == 1,
            processes: processes.map(ProcessView::from).collect(),
        }
    }
}

impl From<&ProcessStatus> for ProcessView {
    fn from(it: &ProcessStatus) -> Self {
        let counters = it.counters.iter().take(it.counters_count as usize);
        Self {
            name: it.process.to_string(),
            state: ProcessState::from_number(it.state).map_or("unknown", ProcessState::word),
            pid: it.pid,
            restarts: it.restarts,
            received_per_s: it.received_per_s,
            sent_per_s: it.sent_per_s,
            lost: it.lost,
            refused: it.refused,
            cpu: it.cpu,
            resident_bytes: it.resident_bytes,
            note: it.note.to_string(),
            counters: counters.map(|counter| (counter.name.to_string(), counter.value)).collect(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use messages::Text;

    #[test]
    fn a_status_is_serialised_with_its_processes() {
        let mut status = DeploymentStatus { deployment: Text::new("demo"), uptime_ms: 1500, count: 1, ..DeploymentStatus::default() };
        status.processes[0] =
            ProcessStatus { process: Text::new("mapping"), state: ProcessState::Backoff as u32, restarts: 2, ..ProcessStatus::default() };
        let json = serde_json::to_value(Status::from(&status)).unwrap();
        assert_eq!((&json["kind"], &json["uptime_s"]), (&"status".into(), &1.5.into()));
        let process = &json["processes"][0];
        assert_eq!((&process["state"], &process["restarts"]), (&"backoff".into(), &2.into()));
        assert_eq!(json["processes"].as_array().unwrap().len(), 1);
    }
}
