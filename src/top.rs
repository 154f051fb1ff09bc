//! `stillmap top`: a table of the processes of a running deployment, updated every second.

use crate::args::Which;
use crate::keys::{Keys, Pressed};
use crate::running::choose;
use crate::status::{COLUMNS, HEAD, cells, is_text, processes, widths};
use bus::Received;
use messages::{DeploymentStatus, ProcessState, ProcessStatus};
use ratatui::backend::{Backend, CrosstermBackend};
use ratatui::crossterm::execute;
use ratatui::crossterm::terminal::{EnterAlternateScreen, LeaveAlternateScreen, disable_raw_mode, enable_raw_mode};
use ratatui::layout::{Constraint, Layout};
use ratatui::style::{Color, Style, Stylize};
use ratatui::text::Line;
use ratatui::widgets::{Cell, Paragraph, Row, Table};
use ratatui::{Frame, Terminal};
use runtime::{Observer, flag_of_ends};
use std::cell;
use std::io::{self, IsTerminal, Write};
use std::rc::Rc;
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

/// Space between two columns.
const GAP: usize = 2;
/// Column of the name of the process.
const PROCESS: usize = 0;
/// Column of its state.
const STATE: usize = 1;
/// Column of its note.
const NOTE: usize = 13;
/// Least width of the note.
const NOTE_LEAST: usize = 16;
/// Columns that a narrow terminal hides, in this order: heartbeat, memory, pid, note, refused, out/s, cpu, in/s, 99 %.
const HIDDEN_FIRST: [usize; 9] = [4, 12, 2, NOTE, 10, 6, 11, 5, 8];
/// Time between two checks for a key.
const KEY_PERIOD: Duration = Duration::from_millis(100);
/// Without a status for this time the deployment has ended or its supervisor hangs.
const PATIENCE: Duration = Duration::from_secs(5);

/// Shows the processes until q is pressed, the terminal closes or the deployment ends.
pub(crate) fn top(which: &Which) -> anyhow::Result<()> {
    let domain = choose(which)?;
    let draws = io::stdout().is_terminal() && std::env::var_os("TERM").is_some_and(|term| !term.is_empty() && term != "dumb");
    anyhow::ensure!(draws, "standard output is not a terminal that can be drawn on: `stillmap status` prints the same table once");
    let mut tool = Observer::join(&domain)?;
    let mut statuses = tool.reader::<DeploymentStatus>()?;
    let keys = Keys::open()?;
    // A terminal that is still there gets its former state back.
    let is_ended = flag_of_ends()?;
    enable_raw_mode()?;
    let mut screen = Screen::default();
    let opened = execute!(screen, EnterAlternateScreen).and_then(|()| Terminal::new(CrosstermBackend::new(screen.clone())));
    let result = opened.map_err(Into::into).and_then(|mut terminal| {
        let is_watched = || Ok(!screen.is_closed.get() && !is_ended.load(Ordering::Relaxed) && keys.wait(KEY_PERIOD)? == Pressed::Nothing);
        watch(&mut terminal, is_watched, || {
            let mut newest = None;
            while let Some(received) = statuses.take()? {
                if let Received::Message(status) = received {
                    newest = Some(*status);
                }
            }
            Ok(newest)
        })
    });
    // A closed terminal needs neither.
    let _ = disable_raw_mode();
    let _ = execute!(screen, LeaveAlternateScreen);
    result
}

/// Standard output. Text for a terminal that is closed is dropped: ratatui panics if it cannot show the cursor at the end.
#[derive(Debug, Clone, Default)]
struct Screen {
    is_closed: Rc<cell::Cell<bool>>,
}

impl Screen {
    fn write_or_drop(&self, write: impl FnOnce(&mut io::StdoutLock<'_>) -> io::Result<()>) {
        if write(&mut io::stdout().lock()).is_err() {
            self.is_closed.set(true);
        }
    }
}

impl Write for Screen {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.write_or_drop(|stdout| stdout.write_all(bytes));
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        self.write_or_drop(|stdout| stdout.flush());
        Ok(())
    }
}

fn watch<B: Backend<Error = io::Error>>(
    terminal: &mut Terminal<B>,
    is_watched: impl Fn() -> io::Result<bool>,
    mut take: impl FnMut() -> anyhow::Result<Option<DeploymentStatus>>,
) -> anyhow::Result<()> {
    let mut received = Instant::now();
    let mut shown: Option<DeploymentStatus> = None;
    loop {
        if let Some(status) = take()? {
            shown = Some(status);
            received = Instant::now();
        }
        let is_over = shown.as_ref().is_some_and(|status| processes(status).all(ProcessStatus::is_over));
        if is_over || received.elapsed() > PATIENCE {
            break;
        }
        terminal.draw(|frame| draw(frame, shown.as_ref()))?;
        if !is_watched()? {
            break;
        }
    }
    Ok(())
}

fn draw(frame: &mut Frame<'_>, status: Option<&DeploymentStatus>) {
    let [head, body, foot] = Layout::vertical([Constraint::Length(1), Constraint::Min(1), Constraint::Length(1)]).areas(frame.area());
    let Some(status) = status else { return frame.render_widget("waiting for a status of the supervisor", head) };
    let ending = if status.ending == 1 { ", ending" } else { "" };
    let title = format!("{}, up {:.0} s{ending}", status.deployment, status.uptime_ms as f64 / 1e3);
    frame.render_widget(Line::from(title).bold(), head);
    frame.render_widget(table(status, usize::from(body.width)), body);
    let legend = "latency: from sensor to receipt at the busiest input, median and 99 %.  q: quit";
    frame.render_widget(Paragraph::new(legend).dim(), foot);
}

/// The columns that fit, each as wide as its cells; the note takes the rest.
fn table(status: &DeploymentStatus, room: usize) -> Table<'static> {
    let widths = widths(&processes(status).map(cells).collect::<Vec<_>>());
    let shown = shown(&widths, room);
    let header = shown.iter().map(|column| aligned(HEAD[*column].to_owned(), *column));
    let constraints = shown.iter().map(|column| match *column {
        NOTE => Constraint::Min(0),
        column => Constraint::Length(widths[column] as u16),
    });
    let rows = processes(status).map(|it| row(it, &shown)).collect::<Vec<_>>();
    Table::new(rows, constraints.collect::<Vec<_>>()).column_spacing(GAP as u16).header(Row::new(header).style(Style::new().dim()))
}

/// The columns that fit into a terminal of this width.
fn shown(widths: &[usize; COLUMNS], room: usize) -> Vec<usize> {
    let mut shown: Vec<usize> = (0..COLUMNS).collect();
    for hidden in HIDDEN_FIRST {
        let needed: usize = shown.iter().map(|column| GAP + if *column == NOTE { NOTE_LEAST } else { widths[*column] }).sum();
        if needed <= room + GAP {
            break;
        }
        shown.retain(|column| *column != hidden);
    }
    shown
}

fn row(it: &ProcessStatus, shown: &[usize]) -> Row<'static> {
    let colour = match ProcessState::from_number(it.state) {
        Some(ProcessState::Running) => Color::Green,
        Some(ProcessState::Starting | ProcessState::Stopping) => Color::Yellow,
        Some(ProcessState::Backoff | ProcessState::Failed) | None => Color::Red,
        Some(ProcessState::Waiting | ProcessState::Finished) => Color::Gray,
    };
    let cells = cells(it);
    Row::new(shown.iter().map(|column| match (*column, aligned(cells[*column].clone(), *column)) {
        (PROCESS, cell) => cell.bold(),
        (STATE, cell) => cell.style(Style::new().fg(colour)),
        (_, cell) => cell,
    }))
}

fn aligned(text: String, column: usize) -> Cell<'static> {
    Cell::from(if is_text(column) { Line::from(text) } else { Line::from(text).right_aligned() })
}

#[cfg(test)]
mod tests {
    use super::*;
    use messages::Text;
    use ratatui::backend::TestBackend;

    #[test]
    fn every_process_has_a_row_with_its_latencies() {
        let mut status = DeploymentStatus { deployment: Text::new("demo"), uptime_ms: 12_400, count: 1, ..DeploymentStatus::default() };
        status.processes[0] = ProcessStatus {
            process: Text::new("mapping"),
            state: ProcessState::Running as u32,
            restarts: 2,
            lost: 7,
            latency_median_us: 180,
            latency_p99_us: 12_400,
            note: Text::new("a word"),
            ..ProcessStatus::default()
        };
        let text = |width| {
            let mut terminal = Terminal::new(TestBackend::new(width, 5)).unwrap();
            terminal.draw(|frame| draw(frame, Some(&status))).unwrap();
            terminal.backend().to_string()
        };
        for (width, also) in [(160, "a word"), (120, "refused"), (80, "q: quit")] {
            let text = text(width);
            for expected in ["demo, up 12 s", "mapping", "running", "restarts", "180 µs", "12.4 ms", " lost ", also] {
                assert!(text.contains(expected), "{expected} is missing at {width}:\n{text}");
            }
        }
        assert!(!text(80).contains("memory"), "{}", text(80));
        let _ = text(1);
    }
}
