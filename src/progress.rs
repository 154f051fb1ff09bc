//! How far a drive is: a bar on a terminal, a line now and then elsewhere.

use indicatif::{MultiProgress, ProgressBar, ProgressStyle};
use messages::{DeploymentStatus, ProcessState, ProcessStatus};
use std::io::IsTerminal;
use std::time::Duration;

/// Counters by which a process tells how far it is: so many of so many.
const DONE: &str = "done";
const TOTAL: &str = "total";
/// Lines between nothing and everything where there is no terminal.
const LINES: u64 = 10;

/// The view of a run.
pub(crate) struct Progress {
    view: View,
}

enum View {
    Bar(ProgressBar),
    Lines { told: u64 },
}

impl Progress {
    pub(crate) fn new(bars: &MultiProgress) -> Self {
        if !std::io::stderr().is_terminal() {
            return Self { view: View::Lines { told: 0 } };
        }
        let bar = bars.add(ProgressBar::no_length());
        bar.set_style(spinner());
        bar.enable_steady_tick(Duration::from_millis(200));
        Self { view: View::Bar(bar) }
    }

    /// Shows the state of the run.
    pub(crate) fn show(&mut self, status: &DeploymentStatus) {
        let processes = status.processes.iter().take(status.count as usize);
        let mut at_work = processes.clone().filter(|process| process.state == ProcessState::Running as u32);
        let drive = at_work.find_map(|process| Some((process, counter(process, DONE)?, counter(process, TOTAL)?)));
        match &mut self.view {
            View::Bar(bar) => {
                if let Some((_, done, total)) = drive.filter(|(_, _, total)| *total > 0) {
                    if bar.length() != Some(total) {
                        bar.set_style(bar_style());
                        bar.set_length(total);
                    }
                    bar.set_position(done.min(total));
                }
                bar.set_message(message(drive.map(|(process, _, _)| process), processes));
            }
            View::Lines { told } => {
                let Some((process, done, total)) = drive.filter(|(_, _, total)| *total > 0) else { return };
                let tenths = done.min(total) * LINES / total;
                if tenths > *told {
                    *told = tenths;
                    tracing::info!(process = process.process.as_str(), "{} % done: {}", tenths * 100 / LINES, process.note);
                }
            }
        }
    }

    /// Takes the view away.
    pub(crate) fn end(self) {
        if let View::Bar(bar) = self.view {
            bar.finish_and_clear();
        }
    }
}

/// A bar for a file that is read, on a terminal only.
pub(crate) fn of_bytes(bars: &MultiProgress, total: u64) -> ProgressBar {
    bars.add(ProgressBar::new(total)).with_style(bar_style())
}

fn counter(process: &ProcessStatus, name: &str) -> Option<u64> {
    let counters = process.counters.iter().take(process.counters_count as usize);
    counters.into_iter().find(|counter| counter.name.as_str() == name).map(|counter| counter.value)
}

/// What the drive says of itself, then who is not well.
fn message<'a>(drive: Option<&ProcessStatus>, processes: impl Iterator<Item = &'a ProcessStatus>) -> String {
    let unwell = |process: &&ProcessStatus| {
        matches!(ProcessState::from_number(process.state), Some(ProcessState::Starting | ProcessState::Backoff | ProcessState::Failed))
    };
    let word = |process: &ProcessStatus| ProcessState::from_number(process.state).map_or("", ProcessState::word);
    let unwell = processes.filter(unwell).map(|process| format!("{} {}", process.process, word(process)));
    drive.map(|process| process.note.to_string()).into_iter().filter(|note| !note.is_empty()).chain(unwell).collect::<Vec<_>>().join("; ")
}

fn spinner() -> ProgressStyle {
    ProgressStyle::with_template("{spinner} {elapsed_precise} {wide_msg}").unwrap_or_else(|_| ProgressStyle::default_spinner())
}

fn bar_style() -> ProgressStyle {
    ProgressStyle::with_template("{bar:40} {percent:>3} %  {wide_msg}").unwrap_or_else(|_| ProgressStyle::default_bar())
}
