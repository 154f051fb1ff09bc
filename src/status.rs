//! `stillmap status`: the processes of running deployments, from their supervisors.

use crate::args::Which;
use crate::observed::statuses;
use crate::running::{choose, none_running};
use crate::status_json::{self, DeploymentJson};
use crate::{exit, output};
use bus::RunningDomain;
use clap::Args;
use messages::{DeploymentStatus, ProcessState, ProcessStatus, printable};

/// Arguments of `stillmap status`.
#[derive(Debug, Args)]
pub(crate) struct StatusArgs {
    /// Print JSON instead of a table
    #[arg(long)]
    json: bool,
    /// Print the JSON schema of that output and end
    #[arg(long, conflicts_with_all = ["json", "deployment"])]
    schema: bool,
    #[command(flatten)]
    which: Which,
}

/// Prints the status of one deployment or of all that are running; the exit code.
pub(crate) fn status(args: &StatusArgs) -> anyhow::Result<u8> {
    let StatusArgs { json, schema, which } = args;
    if *schema {
        output::write(&status_json::schema())?;
        return Ok(exit::SUCCESS);
    }
    let domains = match &which.deployment {
        Some(_) => vec![choose(which)?],
        None => RunningDomain::all()?,
    };
    let statuses = statuses(&domains)?;
    if *json {
        let all: Vec<DeploymentJson> = statuses.iter().map(|(domain, status)| DeploymentJson::of(domain, status.as_ref())).collect();
        output::json(&serde_json::to_string_pretty(&all)?)?;
    } else if statuses.is_empty() {
        output::line(&none_running())?;
    } else {
        let silent = |domain: &RunningDomain| format!("{}, process {}: does not respond\n", domain.name(), domain.pid());
        let tables: Vec<String> =
            statuses.iter().map(|(domain, status)| status.as_ref().map_or_else(|| silent(domain), as_table)).collect();
        output::write(&tables.join("\n"))?;
    }
    Ok(code(&statuses))
}

/// The exit code: the worst state of all decides.
fn code(statuses: &[(&RunningDomain, Option<DeploymentStatus>)]) -> u8 {
    let has_failed = |status: &DeploymentStatus| processes(status).any(|it| it.state == ProcessState::Failed as u32);
    if statuses.is_empty() {
        exit::NOT_RUNNING
    } else if statuses.iter().any(|(_, status)| status.is_none()) {
        exit::FAILURE
    } else if statuses.iter().any(|(_, status)| status.as_ref().is_some_and(has_failed)) {
        exit::INCOMPLETE
    } else {
        exit::SUCCESS
    }
}

/// A latency with its unit, or a dash if none was measured.
pub(crate) fn latency_text(us: u32) -> String {
    match us {
        0 => "-".to_owned(),
        1..1_000 => format!("{us} µs"),
        1_000..1_000_000 => format!("{:.1} ms", f64::from(us) / 1e3),
        _ => format!("{:.1} s", f64::from(us) / 1e6),
    }
}

pub(crate) fn word(process: &ProcessStatus) -> &'static str {
    ProcessState::from_number(process.state).map_or("unknown", ProcessState::word)
}

pub(crate) fn processes(status: &DeploymentStatus) -> impl Iterator<Item = &ProcessStatus> {
    status.processes.iter().take(status.count as usize)
}

/// Number of columns of the table.
pub(crate) const COLUMNS: usize = 14;
/// Names of the columns. The last one holds text of any length.
pub(crate) const HEAD: [&str; COLUMNS] =
    ["process", "state", "pid", "restarts", "heartbeat", "in/s", "out/s", "latency", "99 %", "lost", "refused", "cpu", "memory", "note"];

/// The cells of one process.
pub(crate) fn cells(it: &ProcessStatus) -> [String; COLUMNS] {
    let beat = if it.heartbeat_age_ms == u64::MAX { "-".to_owned() } else { format!("{:.1} s", it.heartbeat_age_ms as f64 / 1e3) };
    [
        printable(it.process.as_str()).into_owned(),
        word(it).to_owned(),
        if it.pid == 0 { "-".to_owned() } else { it.pid.to_string() },
        it.restarts.to_string(),
        beat,
        format!("{:.1}", it.received_per_s),
        format!("{:.1}", it.sent_per_s),
        latency_text(it.latency_median_us),
        latency_text(it.latency_p99_us),
        it.lost.to_string(),
        it.refused.to_string(),
        format!("{:.1} %", it.cpu * 100.0),
        format!("{:.1} MB", it.resident_bytes as f64 / 1e6),
        printable(it.note.as_str()).into_owned(),
    ]
}

/// Whether a column holds text, which is aligned left; numbers are aligned right.
pub(crate) fn is_text(column: usize) -> bool {
    matches!(column, 0 | 1 | 13)
}

/// Width of each column: that of its widest cell.
pub(crate) fn widths(rows: &[[String; COLUMNS]]) -> [usize; COLUMNS] {
    std::array::from_fn(|column| rows.iter().map(|row| row[column].chars().count()).max().unwrap_or(0).max(HEAD[column].len()))
}

fn as_table(status: &DeploymentStatus) -> String {
    let rows: Vec<_> = processes(status).map(cells).collect();
    let widths = widths(&rows);
    let ending = if status.ending == 1 { ", ending" } else { "" };
    let mut text = format!("{}, up {:.0} s{ending}\n", status.deployment, status.uptime_ms as f64 / 1e3);
    for row in std::iter::once(&HEAD.map(str::to_owned)).chain(&rows) {
        let cells = row.iter().zip(widths).enumerate().map(|(column, (cell, width))| match is_text(column) {
            true => format!("{cell:<width$}"),
            false => format!("{cell:>width$}"),
        });
        text.push_str(cells.collect::<Vec<_>>().join("  ").trim_end());
        text.push('\n');
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use messages::Text;

    #[test]
    fn the_table_has_a_row_for_each_process() {
        let mut status = DeploymentStatus { deployment: Text::new("demo"), uptime_ms: 12_400, count: 2, ..DeploymentStatus::default() };
        status.processes[0] = ProcessStatus {
            process: Text::new("mapping"),
            note: Text::new("12 tiles"),
            heartbeat_age_ms: 120,
            received_per_s: 10.04,
            latency_median_us: 180,
            latency_p99_us: 12_400,
            cpu: 0.013,
            resident_bytes: 4_200_000,
            pid: 4711,
            state: ProcessState::Running as u32,
            ..ProcessStatus::default()
        };
        status.processes[1] = ProcessStatus {
            process: Text::new("pioneer"),
            heartbeat_age_ms: u64::MAX,
            state: ProcessState::Backoff as u32,
            restarts: 2,
            ..ProcessStatus::default()
        };
        let expected = "\
demo, up 12 s
process  state     pid  restarts  heartbeat  in/s  out/s  latency     99 %  lost  refused    cpu  memory  note
mapping  running  4711         0      0.1 s  10.0    0.0   180 µs  12.4 ms     0        0  1.3 %  4.2 MB  12 tiles
pioneer  backoff     -         2          -   0.0    0.0        -        -     0        0  0.0 %  0.0 MB
";
        assert_eq!(as_table(&status), expected);
    }
}
