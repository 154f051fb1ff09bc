//! Progress of a run: a bar on a terminal, a line for each tenth elsewhere.

use crate::terminal::Abilities;
use indicatif::{MultiProgress, ProgressBar, ProgressStyle};
use messages::{DeploymentStatus, ProcessState, ProcessStatus, printable};
use std::time::Duration;

/// Counters in which a process reports its progress.
const DONE: &str = "done";
const TOTAL: &str = "total";
/// Number of lines of a whole run without a terminal.
const LINES: u64 = 10;

/// The view of a run.
pub(crate) struct Progress {
    view: View,
}

enum View {
    Bar(ProgressBar),
    Lines { printed: u64 },
}

impl Progress {
    pub(crate) fn new(bars: &MultiProgress) -> Self {
        if !Abilities::of_stderr().draws {
            return Self { view: View::Lines { printed: 0 } };
        }
        let bar = bars.add(ProgressBar::no_length());
        bar.set_style(spinner());
        bar.enable_steady_tick(Duration::from_millis(200));
        Self { view: View::Bar(bar) }
    }

    /// Shows the progress in a status.
    pub(crate) fn show(&mut self, status: &DeploymentStatus) {
        let processes = status.processes.iter().take(status.count as usize);
        let mut running = processes.clone().filter(|process| process.state == ProcessState::Running as u32);
        let drive = running.find_map(|process| Some((process, counter(process, DONE)?, counter(process, TOTAL)?)));
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
            View::Lines { printed } => {
                let Some((process, done, total)) = drive.filter(|(_, _, total)| *total > 0) else { return };
                let tenths = done.min(total) * LINES / total;
                if tenths > *printed {
                    *printed = tenths;
                    tracing::info!(process = process.process.as_str(), "{} % done: {}", tenths * 100 / LINES, process.note);
                }
            }
        }
    }

    /// Removes the view.
    pub(crate) fn end(self) {
        if let View::Bar(bar) = self.view {
            bar.finish_and_clear();
        }
    }
}

/// A bar for a file that is being read; it is hidden without a terminal.
pub(crate) fn of_bytes(bars: &MultiProgress, total: u64) -> ProgressBar {
    bars.add(ProgressBar::new(total)).with_style(bar_style())
}

/// A bar for drives that are simulated; it is hidden without a terminal.
pub(crate) fn of_drives(bars: &MultiProgress, total: u64) -> ProgressBar {
    let style = ProgressStyle::with_template("{bar:32} {pos} of {len} drives, {eta} left").unwrap_or_else(|_| ProgressStyle::default_bar());
    bars.add(ProgressBar::new(total)).with_style(style)
}

pub(crate) fn counter(process: &ProcessStatus, name: &str) -> Option<u64> {
    let counters = process.counters.iter().take(process.counters_count as usize);
    counters.into_iter().find(|counter| counter.name.as_str() == name).map(|counter| counter.value)
}

/// The note of the drive, then the processes that do not run.
fn message<'a>(drive: Option<&ProcessStatus>, processes: impl Iterator<Item = &'a ProcessStatus>) -> String {
    let failing = |process: &&ProcessStatus| {
        matches!(ProcessState::from_number(process.state), Some(ProcessState::Starting | ProcessState::Backoff | ProcessState::Failed))
    };
    let word = |process: &ProcessStatus| ProcessState::from_number(process.state).map_or("", ProcessState::word);
    let failing = processes.filter(failing).map(|process| format!("{} {}", process.process, word(process)));
    let note = drive.map(|process| process.note.to_string()).filter(|note| !note.is_empty());
    printable(&note.into_iter().chain(failing).collect::<Vec<_>>().join("; ")).into_owned()
}

fn spinner() -> ProgressStyle {
    ProgressStyle::with_template("{spinner} {elapsed_precise} {wide_msg}").unwrap_or_else(|_| ProgressStyle::default_spinner())
}

fn bar_style() -> ProgressStyle {
    ProgressStyle::with_template("{bar:40} {percent:>3} %  {wide_msg}").unwrap_or_else(|_| ProgressStyle::default_bar())
}
