//! Log lines: JSON for the supervisor in a process of a deployment, text for people in every other command.
//!
//! A line that cannot be written is lost, and the process continues. tracing does not report lost lines, because that would write to
//! standard error again and panic.

use crate::exit::BadInput;
use crate::terminal::{Abilities, Screen, screen};
use indicatif::MultiProgress;
use messages::printable;
use std::fmt::Write as _;
use std::io::{self, Write};
use std::time::Instant;
use tracing::field::{Field, Visit};
use tracing::{Event, Level, Subscriber};
use tracing_subscriber::EnvFilter;
use tracing_subscriber::fmt::format::Writer;
use tracing_subscriber::fmt::{FmtContext, FormatEvent, FormatFields, MakeWriter};
use tracing_subscriber::registry::LookupSpan;

/// Environment variable with the level of log lines, or the levels of several modules.
const VARIABLE: &str = "STILLMAP_LOG";
/// Without the warnings of iceoryx2 about killed processes: the supervisor cleans up after them.
const DEFAULT: &str = "info,iceoryx2=error";

/// Log lines as JSON on standard error, for the supervisor.
pub(crate) fn for_supervisor() -> anyhow::Result<()> {
    tracing_subscriber::fmt().json().log_internal_errors(false).with_env_filter(filter()?).with_writer(io::stderr).init();
    Ok(())
}

/// Log lines for people on standard error, above the progress bars.
pub(crate) fn for_people(bars: MultiProgress) -> anyhow::Result<()> {
    // Processes have filtered their lines themselves.
    let filter = filter()?.add_directive(format!("{}=trace", supervisor::CHILD_TARGET).parse()?);
    let format = People { started: Instant::now(), colours: Abilities::of_stderr().colours };
    let lines = tracing_subscriber::fmt().log_internal_errors(false).with_env_filter(filter).event_format(format);
    lines.with_writer(AboveBars { bars, screen: screen().clone() }).init();
    Ok(())
}

fn filter() -> anyhow::Result<EnvFilter> {
    let levels = std::env::var(VARIABLE).unwrap_or_else(|_| DEFAULT.to_owned());
    EnvFilter::try_new(&levels).map_err(|error| {
        BadInput(format!("{VARIABLE}={levels}: {error}: expected a level (error, warn, info, debug, trace) or module=level,…")).into()
    })
}

/// One line for each event: seconds since the start, process, message.
struct People {
    started: Instant,
    colours: bool,
}

impl<S, N> FormatEvent<S, N> for People
where
    S: Subscriber + for<'a> LookupSpan<'a>,
    N: for<'a> FormatFields<'a> + 'static,
{
    fn format_event(&self, _: &FmtContext<'_, S, N>, mut writer: Writer<'_>, event: &Event<'_>) -> std::fmt::Result {
        let mut line = Fields::default();
        event.record(&mut line);
        let process = if line.process.is_empty() { "stillmap" } else { &line.process };
        let (colour, mark) = match *event.metadata().level() {
            Level::ERROR => ("31", "error: "),
            Level::WARN => ("33", "warning: "),
            Level::INFO => ("0", ""),
            Level::DEBUG => ("2", "debug: "),
            Level::TRACE => ("2", "trace: "),
        };
        let text = format!("{process:<10} {mark}{}{}", line.message, line.fields);
        let text = format!("{:>8.2} s  {}", self.started.elapsed().as_secs_f64(), printable(&text));
        if self.colours { writeln!(writer, "\x1b[{colour}m{text}\x1b[0m") } else { writeln!(writer, "{text}") }
    }
}

#[derive(Default)]
struct Fields {
    process: String,
    message: String,
    fields: String,
}

impl Fields {
    fn record(&mut self, field: &Field, value: String) {
        match field.name() {
            "process" => self.process = value,
            "message" => self.message = value,
            name => {
                // Writing to a string does not fail.
                let _ = write!(self.fields, " {name}={value}");
            }
        }
    }
}

impl Visit for Fields {
    fn record_str(&mut self, field: &Field, value: &str) {
        self.record(field, value.to_owned());
    }

    fn record_debug(&mut self, field: &Field, value: &dyn std::fmt::Debug) {
        self.record(field, format!("{value:?}"));
    }
}

/// Standard error, with progress bars out of the way while a line is written.
struct AboveBars {
    bars: MultiProgress,
    screen: Screen,
}

impl<'a> MakeWriter<'a> for AboveBars {
    type Writer = &'a Self;

    fn make_writer(&'a self) -> Self::Writer {
        self
    }
}

impl Write for &AboveBars {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.bars.suspend(|| self.screen.push(bytes));
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}
