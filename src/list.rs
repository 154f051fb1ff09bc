//! `stillmap list`: the running deployments, a line for each.

use crate::exit;
use crate::observed::statuses;
use crate::output;
use crate::running::none_running;
use bus::RunningDomain;
use messages::{DeploymentStatus, ProcessState, printable};
use settings::Settings;

const HEAD: [&str; 6] = ["deployment", "state", "up", "processes", "page", "output"];

/// Prints the running deployments; the exit code.
pub(crate) fn list() -> anyhow::Result<u8> {
    let domains = RunningDomain::all()?;
    if domains.is_empty() {
        output::line(&none_running())?;
        return Ok(exit::NOT_RUNNING);
    }
    let rows: Vec<_> = statuses(&domains)?.into_iter().map(|(domain, status)| row(domain, status.as_ref())).collect();
    output::write(&table(&rows))?;
    Ok(exit::SUCCESS)
}

fn row(domain: &RunningDomain, status: Option<&DeploymentStatus>) -> [String; 6] {
    let settings = Settings::read_handed(&domain.directory().join("settings.toml"));
    let out = settings.map_or_else(|_| "-".to_owned(), |settings| settings.out.display().to_string());
    let dash = || "-".to_owned();
    let Some(status) = status else { return [domain.name().to_owned(), "does not respond".to_owned(), dash(), dash(), dash(), out] };
    let running = status.processes().iter().filter(|it| it.state == ProcessState::Running as u32).count();
    let page = status.processes().iter().find(|it| it.note.as_str().starts_with("http://"));
    [
        domain.name().to_owned(),
        if status.ending == 1 { "ending" } else { "running" }.to_owned(),
        format!("{} s", status.uptime_ms / 1000),
        format!("{running} of {}", status.count),
        page.map_or_else(dash, |it| it.note.to_string()),
        out,
    ]
}

/// Aligned columns; the last one has any length.
fn table(rows: &[[String; 6]]) -> String {
    let rows: Vec<[String; 6]> = std::iter::once(HEAD.map(str::to_owned)).chain(rows.iter().cloned()).collect();
    let width = |column: usize| rows.iter().map(|row| row[column].chars().count()).max().unwrap_or(0);
    let line = |row: &[String; 6]| {
        let cells = row.iter().enumerate().map(|(column, cell)| format!("{:<1$}", printable(cell), width(column)));
        format!("{}\n", cells.collect::<Vec<_>>().join("  ").trim_end())
    };
    rows.iter().map(line).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_are_as_wide_as_their_cells() {
        let row = ["demo", "running", "12 s", "8 of 9", "http://127.0.0.1:8088/", "/x/demo-out"].map(str::to_owned);
        let expected = "\
deployment  state    up    processes  page                    output
demo        running  12 s  8 of 9     http://127.0.0.1:8088/  /x/demo-out
";
        assert_eq!(table(&[row]), expected);
    }
}
