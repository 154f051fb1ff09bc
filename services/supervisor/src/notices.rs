//! What people are told, as tracing events; the field `process` says whom it is about.

use crate::child::Child;
use crate::deployment::{Deployment, Ending, Notice};
use crate::lines::LogLine;
use tracing::Level;

/// Target of the tracing events that children wrote.
pub const CHILD_TARGET: &str = "process";

/// Passes on a line that a child wrote.
pub(crate) fn pass_on(process: &str, line: &str) {
    let LogLine { level, text } = LogLine::read(line);
    match level {
        Level::ERROR => tracing::error!(target: CHILD_TARGET, process, "{text}"),
        Level::WARN => tracing::warn!(target: CHILD_TARGET, process, "{text}"),
        Level::INFO => tracing::info!(target: CHILD_TARGET, process, "{text}"),
        Level::DEBUG => tracing::debug!(target: CHILD_TARGET, process, "{text}"),
        Level::TRACE => tracing::trace!(target: CHILD_TARGET, process, "{text}"),
    }
}

/// Tells what happens to the deployment.
pub(crate) fn tell(notice: &Notice, deployment: &Deployment, children: &[Option<Child>]) {
    let name = |process: usize| deployment.processes().get(process).map_or("", |it| it.plan().name.as_str());
    match notice {
        Notice::Up { process } => {
            let pid = children.get(*process).and_then(Option::as_ref).map_or(0, Child::pid);
            let restarts = deployment.processes().get(*process).map_or(0, |it| it.restarted());
            let again = if restarts > 0 { format!(" again, restart {restarts}") } else { String::new() };
            tracing::info!(process = name(*process), "is up{again} (pid {pid})");
        }
        Notice::Restarting { process, cause, after } => {
            tracing::warn!(process = name(*process), "{cause}; starts again in {:.2} s", after.as_secs_f64());
        }
        Notice::Hangs { process, cause } => tracing::warn!(process = name(*process), "{cause}; killed"),
        Notice::Finished { process } => tracing::info!(process = name(*process), "finished"),
        Notice::Failed { process, cause } => tracing::error!(process = name(*process), "failed: {cause}"),
        Notice::Rebuilds => tracing::warn!("the shared memory is broken; everything starts again from its checkpoints"),
        Notice::Ends(ending) => tell_ending(*ending, name),
    }
}

fn tell_ending<'a>(ending: Ending, name: impl Fn(usize) -> &'a str) {
    match ending {
        Ending::Complete => tracing::info!("the drive has ended; what it left is being finished"),
        Ending::NothingLeft => tracing::info!("no process is left"),
        Ending::Asked | Ending::Forced => tracing::info!("stopping; ask once more to hurry"),
        Ending::BadInput { process } => tracing::error!("stopping: {} refused its input", name(process)),
        Ending::Lost { process } => tracing::error!("stopping: nothing can be done without {}", name(process)),
        Ending::DomainBroken => tracing::error!("stopping: the shared memory breaks again and again"),
    }
}
