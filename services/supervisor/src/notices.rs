//! Log lines for people: as tracing events whose field `process` names the process that they are about, and on the bus.

use crate::deployment::Deployment;
use crate::events::{Ending, Notice, Standstill};
use crate::lines::Line;
use bus::{BusError, DeploymentClock, Writer};
use messages::{LogLevel, LogLine, Text};
use tracing::Level;

/// Target of the tracing events that processes wrote.
pub const CHILD_TARGET: &str = "process";
/// The name of the supervisor in log lines.
pub(crate) const SUPERVISOR: &str = "supervisor";

/// Where log lines go.
pub(crate) struct Log {
    bus: Writer<LogLine>,
    clock: DeploymentClock,
    lines: u64,
}

impl Log {
    pub(crate) fn new(bus: Writer<LogLine>, clock: DeploymentClock) -> Self {
        Self { bus, clock, lines: 0 }
    }

    /// Passes on a line that a process wrote.
    pub(crate) fn pass_on(&mut self, process: &str, line: &Line) -> Result<(), BusError> {
        let Line { level, text } = line;
        match *level {
            Level::ERROR => tracing::error!(target: CHILD_TARGET, process, "{text}"),
            Level::WARN => tracing::warn!(target: CHILD_TARGET, process, "{text}"),
            Level::INFO => tracing::info!(target: CHILD_TARGET, process, "{text}"),
            Level::DEBUG => tracing::debug!(target: CHILD_TARGET, process, "{text}"),
            Level::TRACE => tracing::trace!(target: CHILD_TARGET, process, "{text}"),
        }
        self.publish(process, line)
    }

    /// Tells what the supervisor does.
    pub(crate) fn tell(&mut self, notice: &Notice, deployment: &Deployment) -> Result<(), BusError> {
        let (process, line) = words(notice, deployment);
        let Line { level, text } = &line;
        match *level {
            Level::ERROR => tracing::error!(process, "{text}"),
            Level::WARN => tracing::warn!(process, "{text}"),
            _ => tracing::info!(process, "{text}"),
        }
        self.publish(process, &line)
    }

    fn publish(&mut self, process: &str, line: &Line) -> Result<(), BusError> {
        let level = match line.level {
            Level::ERROR => LogLevel::Error,
            Level::WARN => LogLevel::Warning,
            Level::INFO => LogLevel::Info,
            Level::DEBUG | Level::TRACE => LogLevel::Debug,
        };
        self.lines += 1;
        self.bus.send_with(self.lines, self.clock.now_ns(), |message| {
            message.process = Text::new(process);
            message.message = Text::new(&line.text);
            message.level = level as u32;
        })
    }
}

/// The process that a notice is about, and the line.
pub(crate) fn words<'d>(notice: &Notice, deployment: &'d Deployment) -> (&'d str, Line) {
    let name = |process: usize| deployment.processes().get(process).map_or("", |it| it.plan().name.as_str());
    let info = |text: String| Line { level: Level::INFO, text };
    let warning = |text: String| Line { level: Level::WARN, text };
    let error = |text: String| Line { level: Level::ERROR, text };
    match notice {
        Notice::Up { process } => {
            let restarts = deployment.processes().get(*process).map_or(0, |it| it.restarted());
            (name(*process), info(if restarts > 0 { format!("is up again (restart {restarts})") } else { "is up".to_owned() }))
        }
        Notice::Restarting { process, cause, after } => {
            (name(*process), warning(format!("{cause}; starts again in {:.2} s", after.as_secs_f64())))
        }
        Notice::RestartRequested { process } => (name(*process), info("restarts on request".to_owned())),
        Notice::Hangs { process, cause } => (name(*process), warning(format!("{cause}; killed"))),
        Notice::Finished { process } => (name(*process), info("finished".to_owned())),
        Notice::Failed { process, cause } => (name(*process), error(format!("failed: {cause}"))),
        Notice::Rebuilds => (SUPERVISOR, warning("the shared memory is broken; everything starts again from its checkpoints".to_owned())),
        Notice::Removed { path } => {
            let cause = "a cleaner removes old files, and logind those of a user at the last logout (RemoveIPC=, loginctl enable-linger)";
            (SUPERVISOR, warning(format!("{} was removed: {cause}; every process is restarted from its checkpoint", path.display())))
        }
        Notice::Restless { after } => {
            (SUPERVISOR, warning(format!("what is being finished still moves after {:.0} s; it is stopped", after.as_secs_f64())))
        }
        Notice::StoodStill(Standstill::Stopped(time)) => {
            let cause = "stopped, frozen with its container, or without a processor";
            (SUPERVISOR, warning(format!("stood still for {:.1} s ({cause}); no process is blamed for that time", time.as_secs_f64())))
        }
        Notice::StoodStill(Standstill::Suspended(time)) => (
            SUPERVISOR,
            warning(format!("the computer was suspended for {:.0} s; what the robot did meanwhile is missing", time.as_secs_f64())),
        ),
        Notice::Lost { process, count } => (name(*process), warning(format!("{count} messages lost so far"))),
        Notice::DiskLow { path, free_mb } => {
            (SUPERVISOR, warning(format!("the disk of {} is nearly full: {free_mb} MB are left", path.display())))
        }
        Notice::Ends(ending) => {
            let line = match *ending {
                Ending::Complete => info("the drive has ended; what it left is being finished".to_owned()),
                Ending::NothingLeft => info("no process is left".to_owned()),
                Ending::Asked | Ending::Forced => info("stopping in order; asking once more hurries".to_owned()),
                Ending::BadInput { process } => error(format!("stopping: {} refused its input", name(process))),
                Ending::Lost { process } => error(format!("stopping: nothing can be done without {}", name(process))),
                Ending::DomainBroken => error("stopping: the shared memory breaks again and again".to_owned()),
            };
            (SUPERVISOR, line)
        }
    }
}
