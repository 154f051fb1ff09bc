//! `stillmap top`: the processes of a running deployment, as they are from second to second.

use crate::cli::Which;
use crate::status::{choose, latency_words, processes, word};
use bus::{Received, Tool};
use messages::{DeploymentStatus, ProcessState, ProcessStatus};
use ratatui::crossterm::event::{self, Event, KeyCode, KeyModifiers};
use ratatui::layout::{Constraint, Layout};
use ratatui::style::{Color, Style, Stylize};
use ratatui::text::Line;
use ratatui::widgets::{Cell, Paragraph, Row, Table};
use ratatui::{DefaultTerminal, Frame};
use std::io::IsTerminal;
use std::time::{Duration, Instant};

/// How long keys may wait.
const LOOK: Duration = Duration::from_millis(100);
/// Without a status for so long, the deployment has ended or hangs.
const PATIENCE: Duration = Duration::from_secs(5);

/// Shows the processes until somebody presses q, or the deployment ends; the exit code.
pub(crate) fn top(which: &Which) -> anyhow::Result<u8> {
    let domain = choose(which)?;
    anyhow::ensure!(std::io::stdout().is_terminal(), "standard output is no terminal: `stillmap status` tells the same once");
    let mut tool = Tool::join(&domain)?;
    let mut statuses = tool.reader::<DeploymentStatus>()?;
    let mut terminal = ratatui::try_init()?;
    let result = watch(&mut terminal, || {
        let mut newest = None;
        while let Some(received) = statuses.take()? {
            if let Received::Message(status) = received {
                newest = Some(*status);
            }
        }
        Ok(newest)
    });
    ratatui::restore();
    result
}

fn watch(terminal: &mut DefaultTerminal, mut take: impl FnMut() -> anyhow::Result<Option<DeploymentStatus>>) -> anyhow::Result<u8> {
    let mut heard = Instant::now();
    let mut shown: Option<DeploymentStatus> = None;
    loop {
        if let Some(status) = take()? {
            shown = Some(status);
            heard = Instant::now();
        }
        if heard.elapsed() > PATIENCE {
            return Ok(0);
        }
        terminal.draw(|frame| draw(frame, shown.as_ref()))?;
        if event::poll(LOOK)?
            && let Event::Key(key) = event::read()?
            && is_quit(key.code, key.modifiers)
        {
            return Ok(0);
        }
    }
}

fn is_quit(code: KeyCode, modifiers: KeyModifiers) -> bool {
    matches!(code, KeyCode::Char('q') | KeyCode::Esc) || (code == KeyCode::Char('c') && modifiers.contains(KeyModifiers::CONTROL))
}

fn draw(frame: &mut Frame<'_>, status: Option<&DeploymentStatus>) {
    let [head, body, foot] = Layout::vertical([Constraint::Length(1), Constraint::Min(1), Constraint::Length(1)]).areas(frame.area());
    let Some(status) = status else { return frame.render_widget("waiting for the supervisor to tell", head) };
    let ending = if status.ending == 1 { ", ending" } else { "" };
    let title = format!("{}, up {:.0} s{ending}", status.deployment, status.uptime_ms as f64 / 1e3);
    frame.render_widget(Line::from(title).bold(), head);
    let names = ["process", "state", "restarts", "in/s", "out/s", "latency", "99 %", "lost", "cpu", "memory", "note"];
    let widths = [14, 10, 8, 8, 8, 9, 9, 7, 7, 9].map(Constraint::Length).into_iter().chain([Constraint::Min(10)]);
    let table = Table::new(processes(status).map(row), widths).header(Row::new(names).style(Style::new().dim()));
    frame.render_widget(table, body);
    let words = "latency: of its busiest input, from sensor to reading, median and 99 %.  q: quit";
    frame.render_widget(Paragraph::new(words).dim(), foot);
}

fn row(it: &ProcessStatus) -> Row<'static> {
    let colour = match ProcessState::from_number(it.state) {
        Some(ProcessState::Running) => Color::Green,
        Some(ProcessState::Starting | ProcessState::Stopping) => Color::Yellow,
        Some(ProcessState::Backoff | ProcessState::Failed) | None => Color::Red,
        Some(ProcessState::Waiting | ProcessState::Finished) => Color::Gray,
    };
    Row::new([
        Cell::from(it.process.to_string()).bold(),
        Cell::from(word(it)).style(Style::new().fg(colour)),
        Cell::from(it.restarts.to_string()),
        Cell::from(format!("{:.1}", it.received_per_s)),
        Cell::from(format!("{:.1}", it.sent_per_s)),
        Cell::from(latency_words(it.latency_median_us)),
        Cell::from(latency_words(it.latency_p99_us)),
        Cell::from(it.lost.to_string()),
        Cell::from(format!("{:.1} %", it.cpu * 100.0)),
        Cell::from(format!("{:.1} MB", it.resident_bytes as f64 / 1e6)),
        Cell::from(it.note.to_string()),
    ])
}

#[cfg(test)]
mod tests {
    use super::*;
    use messages::Text;
    use ratatui::Terminal;
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
            ..ProcessStatus::default()
        };
        let mut terminal = Terminal::new(TestBackend::new(120, 5)).unwrap();
        terminal.draw(|frame| draw(frame, Some(&status))).unwrap();
        let text = terminal.backend().to_string();
        for expected in ["demo, up 12 s", "mapping", "running", "180 µs", "12.4 ms", "q: quit"] {
            assert!(text.contains(expected), "{expected} is missing:\n{text}");
        }
    }
}
