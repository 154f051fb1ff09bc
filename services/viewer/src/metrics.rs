//! The state of the processes for Prometheus, in its text format 0.0.4.

use std::fmt::{Display, Write};

use messages::{DeploymentStatus, ProcessState, ProcessStatus};

/// The content type of the format.
pub(crate) const CONTENT_TYPE: &str = "text/plain; version=0.0.4";

/// A metric of each process.
struct Metric {
    name: &'static str,
    kind: &'static str,
    help: &'static str,
    value: fn(&ProcessStatus) -> f64,
}

const fn metric(name: &'static str, kind: &'static str, help: &'static str, value: fn(&ProcessStatus) -> f64) -> Metric {
    Metric { name, kind, help, value }
}

/// Microseconds, of which 0 is none measured.
fn seconds(us: u32) -> f64 {
    if us == 0 { f64::NAN } else { f64::from(us) / 1e6 }
}

const METRICS: &[Metric] = &[
    metric("up", "gauge", "1 if the process is at work.", |it| f64::from(u8::from(it.state == ProcessState::Running as u32))),
    metric("failed", "gauge", "1 if the process has failed for good.", |it| f64::from(u8::from(it.state == ProcessState::Failed as u32))),
    metric("restarts_total", "counter", "Restarts.", |it| f64::from(it.restarts)),
    metric("received_total", "counter", "Messages received by the present child.", |it| it.received as f64),
    metric("sent_total", "counter", "Messages sent by the present child.", |it| it.sent as f64),
    metric("lost_total", "counter", "Messages lost.", |it| it.lost as f64),
    metric("refused_total", "counter", "Messages refused.", |it| it.refused as f64),
    metric("latency_median_seconds", "gauge", "Median latency of the busiest input.", |it| seconds(it.latency_median_us)),
    metric("latency_p99_seconds", "gauge", "99th percentile of that latency.", |it| seconds(it.latency_p99_us)),
    metric("cpu_cores", "gauge", "Share of one core.", |it| it.cpu),
    metric("resident_bytes", "gauge", "Resident memory.", |it| it.resident_bytes as f64),
];

/// The metrics of a deployment.
#[must_use]
pub fn metrics(status: &DeploymentStatus) -> String {
    let deployment = Label(status.deployment.as_str());
    let mut text = String::new();
    // Writing to a string cannot fail.
    let mut line = |line: std::fmt::Arguments<'_>| writeln!(text, "{line}").unwrap_or_default();
    line(format_args!("# HELP stillmap_uptime_seconds Time since the start of the deployment.\n# TYPE stillmap_uptime_seconds gauge"));
    line(format_args!("stillmap_uptime_seconds{{deployment=\"{deployment}\"}} {}", status.uptime_ms as f64 / 1e3));
    for Metric { name, kind, help, value } in METRICS {
        line(format_args!("# HELP stillmap_process_{name} {help}\n# TYPE stillmap_process_{name} {kind}"));
        for it in status.processes() {
            let (process, value) = (Label(it.process.as_str()), value(it));
            // One that was not measured has no sample.
            if value.is_finite() {
                line(format_args!("stillmap_process_{name}{{deployment=\"{deployment}\",process=\"{process}\"}} {value}"));
            }
        }
    }
    line(format_args!("# HELP stillmap_process_counter Counters of each process, as stillmap status --json names them."));
    line(format_args!("# TYPE stillmap_process_counter untyped"));
    for it in status.processes() {
        for counter in it.counters.iter().take(it.counters_count as usize) {
            let (process, name) = (Label(it.process.as_str()), Label(counter.name.as_str()));
            let labels = format_args!("deployment=\"{deployment}\",process=\"{process}\",name=\"{name}\"");
            line(format_args!("stillmap_process_counter{{{labels}}} {}", counter.value));
        }
    }
    text
}

/// The value of a label: backslash, quote and line break are escaped.
struct Label<'a>(&'a str);

impl Display for Label<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        self.0.chars().try_for_each(|c| match c {
            '\\' => f.write_str("\\\\"),
            '"' => f.write_str("\\\""),
            '\n' => f.write_str("\\n"),
            c => f.write_char(c),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use messages::{Counter, Text};

    fn status() -> DeploymentStatus {
        let mut status = DeploymentStatus { deployment: Text::new("a\"b\\"), uptime_ms: 1500, count: 1, ..DeploymentStatus::default() };
        status.processes[0] = ProcessStatus {
            process: Text::new("recorder"),
            state: ProcessState::Running as u32,
            restarts: 2,
            latency_p99_us: 1500,
            counters_count: 1,
            ..ProcessStatus::default()
        };
        status.processes[0].counters[0] = Counter { name: Text::new("log\nbytes"), value: u64::MAX };
        status
    }

    #[test]
    fn each_sample_has_its_type_and_labels() {
        let text = metrics(&status());
        for line in [
            "stillmap_uptime_seconds{deployment=\"a\\\"b\\\\\"} 1.5",
            "# TYPE stillmap_process_restarts_total counter",
            "stillmap_process_restarts_total{deployment=\"a\\\"b\\\\\",process=\"recorder\"} 2",
            "stillmap_process_latency_p99_seconds{deployment=\"a\\\"b\\\\\",process=\"recorder\"} 0.0015",
            "stillmap_process_counter{deployment=\"a\\\"b\\\\\",process=\"recorder\",name=\"log\\nbytes\"} 18446744073709551615",
        ] {
            assert!(text.lines().any(|it| it == line), "{line}\n{text}");
        }
        assert!(!text.contains("latency_median_seconds{"), "a latency that was not measured has no sample");
    }

    #[test]
    fn every_line_is_a_comment_or_a_sample() {
        for line in metrics(&status()).lines() {
            let sample = line.rsplit_once("} ").and_then(|(_, value)| value.parse::<f64>().ok());
            assert!(line.starts_with("# HELP stillmap_") || line.starts_with("# TYPE stillmap_") || sample.is_some(), "{line}");
        }
    }
}
