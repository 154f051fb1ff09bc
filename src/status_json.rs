//! What `stillmap status --json` prints. It is an interface for other programs: fields are added, and none is removed or changes its
//! meaning. `config/status.schema.json` is its schema.

use bus::RunningDomain;
use messages::{DeploymentStatus, ProcessState, ProcessStatus};
use schemars::JsonSchema;
use schemars::generate::SchemaSettings;
use serde::Serialize;
use std::collections::BTreeMap;

/// A running deployment.
#[derive(Debug, Serialize, JsonSchema)]
pub(crate) struct DeploymentJson {
    /// Its name.
    deployment: String,
    /// Process id of its supervisor.
    pid: u32,
    /// Its folder among the runtime files.
    folder: String,
    /// Whether its supervisor responds. If not, the fields below are null or empty.
    answers: bool,
    /// Milliseconds since its start.
    uptime_ms: Option<u64>,
    /// Whether it is ending.
    ending: Option<bool>,
    /// Its processes in the order of starting.
    processes: Vec<ProcessJson>,
}

/// A process as its supervisor sees it.
#[derive(Debug, Serialize, JsonSchema)]
struct ProcessJson {
    /// Its name in the deployment.
    process: String,
    /// `waiting`, `starting`, `running`, `backoff`, `stopping`, `finished` or `failed`.
    state: &'static str,
    /// Process id while it runs.
    pid: Option<u32>,
    /// Number of restarts.
    restarts: u32,
    /// Milliseconds since its last heartbeat.
    heartbeat_age_ms: Option<u64>,
    /// Messages that its present child has received.
    received: u64,
    /// Messages that its present child has sent.
    sent: u64,
    /// Messages lost.
    lost: u64,
    /// Messages refused.
    refused: u64,
    /// Messages received per second, recently.
    received_per_s: f64,
    /// Messages sent per second, recently.
    sent_per_s: f64,
    /// Median latency of its busiest input, microseconds.
    latency_median_us: Option<u32>,
    /// 99th percentile of that latency, microseconds.
    latency_p99_us: Option<u32>,
    /// Share of one core, recently.
    cpu: f64,
    /// Resident memory, bytes.
    resident_bytes: u64,
    /// The note of its last heartbeat, or why it is down.
    note: String,
    /// Its counters by name.
    counters: BTreeMap<String, u64>,
}

impl DeploymentJson {
    pub(crate) fn of(domain: &RunningDomain, status: Option<&DeploymentStatus>) -> Self {
        Self {
            deployment: domain.name().to_owned(),
            pid: domain.pid(),
            folder: domain.directory().display().to_string(),
            answers: status.is_some(),
            uptime_ms: status.map(|status| status.uptime_ms),
            ending: status.map(|status| status.ending == 1),
            processes: status.iter().flat_map(|status| status.processes()).map(ProcessJson::from).collect(),
        }
    }
}

impl From<&ProcessStatus> for ProcessJson {
    fn from(it: &ProcessStatus) -> Self {
        let is_measured = it.latency_p99_us != 0;
        Self {
            process: it.process.to_string(),
            state: ProcessState::from_number(it.state).map_or("unknown", ProcessState::word),
            pid: (it.pid != 0).then_some(it.pid),
            restarts: it.restarts,
            heartbeat_age_ms: (it.heartbeat_age_ms != u64::MAX).then_some(it.heartbeat_age_ms),
            received: it.received,
            sent: it.sent,
            lost: it.lost,
            refused: it.refused,
            received_per_s: it.received_per_s,
            sent_per_s: it.sent_per_s,
            latency_median_us: is_measured.then_some(it.latency_median_us),
            latency_p99_us: is_measured.then_some(it.latency_p99_us),
            cpu: it.cpu,
            resident_bytes: it.resident_bytes,
            note: it.note.to_string(),
            counters: it.counters.iter().take(it.counters_count as usize).map(|it| (it.name.to_string(), it.value)).collect(),
        }
    }
}

/// The JSON schema of the output.
pub(crate) fn schema() -> String {
    let generator = SchemaSettings::draft2020_12().for_serialize().into_generator();
    format!("{:#}\n", generator.into_root_schema_for::<Vec<DeploymentJson>>().to_value())
}

#[cfg(test)]
mod tests {
    use super::*;
    use messages::{Counter, Text};
    use serde_json::json;

    #[test]
    fn the_schema_is_current() {
        let path = concat!(env!("CARGO_MANIFEST_DIR"), "/config/status.schema.json");
        let found = std::fs::read_to_string(path).unwrap_or_default();
        assert!(found == schema(), "config/status.schema.json is out of date; renew it: cargo run -- status --schema > {path}");
    }

    #[test]
    fn what_was_not_measured_is_null() {
        let mut it = ProcessStatus {
            process: Text::new("std"),
            heartbeat_age_ms: u64::MAX,
            state: 3,
            counters_count: 1,
            ..ProcessStatus::default()
        };
        it.counters[0] = Counter { name: Text::new("cells"), value: 4 };
        let value = serde_json::to_value(ProcessJson::from(&it)).unwrap();
        for key in ["pid", "heartbeat_age_ms", "latency_median_us", "latency_p99_us"] {
            assert_eq!(value[key], json!(null), "{key}");
        }
        assert_eq!((&value["state"], &value["counters"]), (&json!("backoff"), &json!({ "cells": 4 })));
    }
}
