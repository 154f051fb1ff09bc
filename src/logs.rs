//! `stillmap logs`: the log lines of a running deployment.

use crate::args::Which;
use crate::exit::BadInput;
use crate::observed::{Observed, PATIENCE};
use crate::output;
use crate::running::choose;
use bus::{Reader, Received};
use clap::Args;
use messages::{LogLevel, LogLine, printable};
use settings::Settings;
use std::time::{Duration, Instant};

/// Arguments of `stillmap logs`.
#[derive(Debug, Args)]
pub(crate) struct LogsArgs {
    /// Process whose lines are printed, or "supervisor"; all if it is not given
    #[arg(value_name = "PROCESS")]
    process: Option<String>,
    /// Print new lines as they come, until the deployment ends
    #[arg(short, long)]
    follow: bool,
    #[command(flatten)]
    which: Which,
}

/// How often the end of the deployment is looked for while no line comes.
const LOOK: Duration = Duration::from_millis(500);
/// The sender of the supervisor's own lines.
const SUPERVISOR: &str = "supervisor";

/// Prints the last lines, and with `follow` the new ones.
pub(crate) fn logs(args: &LogsArgs) -> anyhow::Result<()> {
    let LogsArgs { process, follow, which } = args;
    let domain = choose(which)?;
    if let Some(name) = process {
        let settings = Settings::read_handed(&domain.directory().join("settings.toml"))?;
        if name != SUPERVISOR && !settings.process.iter().any(|it| it.name.as_str() == name) {
            return Err(BadInput(format!("deployment {} has no process {name}", domain.name())).into());
        }
    }
    let mut observed = Observed::join(&domain)?;
    let mut lines: Reader<LogLine> = observed.observer.reader()?;
    // The supervisor hands its last lines to a new reader, and sends a status each second: with the second status the lines are there.
    let (mut statuses, mut heard) = (0, Instant::now());
    loop {
        if observed.take()?.is_some() {
            (statuses, heard) = (statuses + 1, Instant::now());
        }
        while let Some(received) = lines.take()? {
            let Received::Message(line) = received else { continue };
            if process.as_ref().is_none_or(|name| name == line.process.as_str()) {
                output::line(&text(&line))?;
            }
        }
        if statuses >= 2 && !follow || heard.elapsed() > PATIENCE {
            return Ok(());
        }
        observed.observer.wait(LOOK)?;
    }
}

fn text(line: &LogLine) -> String {
    let level = match LogLevel::from_number(line.level) {
        Some(LogLevel::Debug) => "DEBUG",
        Some(LogLevel::Warning) => "WARN ",
        Some(LogLevel::Error) => "ERROR",
        Some(LogLevel::Info) | None => "INFO ",
    };
    format!("{level} {}: {}", printable(line.process.as_str()), printable(line.message.as_str()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use messages::Text;

    #[test]
    fn a_line_names_its_level_and_process() {
        let line = LogLine { process: Text::new("std"), message: Text::new("resumes"), level: LogLevel::Warning as u32, reserved: 0 };
        assert_eq!(text(&line), "WARN  std: resumes");
    }
}
