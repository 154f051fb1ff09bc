//! `stillmap restart`: another child for a process of a running deployment.

use crate::args::Which;
use crate::exit::BadInput;
use crate::observed::{Observed, PATIENCE, process};
use crate::output;
use crate::running::choose;
use clap::Args;
use messages::{DeploymentStatus, ProcessState, ProcessStatus};
use settings::Settings;
use std::time::{Duration, Instant};
use supervisor::request_restart;

/// Arguments of `stillmap restart`.
#[derive(Debug, Args)]
pub(crate) struct RestartArgs {
    /// Process to restart
    #[arg(value_name = "PROCESS")]
    process: String,
    #[command(flatten)]
    which: Which,
}

/// Requests a restart and waits until the new child works.
pub(crate) fn restart(args: &RestartArgs) -> anyhow::Result<()> {
    let RestartArgs { process: name, which } = args;
    let domain = choose(which)?;
    let settings = Settings::read_handed(&domain.directory().join("settings.toml"))?;
    if !settings.process.iter().any(|it| it.name.as_str() == name) {
        let names = settings.process.iter().map(|it| it.name.to_string()).collect::<Vec<_>>().join(", ");
        return Err(BadInput(format!("deployment {} has no process {name}: it has {names}", domain.name())).into());
    }
    let mut observed = Observed::join(&domain)?;
    let before = observed.next()?.ok_or_else(|| no_response(domain.name()))?;
    let before = restartable(&before, name)?;
    request_restart(domain.directory(), name)?;
    let deadline = Instant::now() + PATIENCE + Duration::from_secs_f64(settings.supervisor.startup_deadline_s.get());
    loop {
        let status = observed.next()?.ok_or_else(|| no_response(domain.name()))?;
        let Some(now) = process(&status, name).filter(|now| now.restarts > before.restarts) else {
            if Instant::now() > deadline || status.ending == 1 {
                return Err(anyhow::anyhow!("{name} was not restarted: the deployment ends, or starts again in new shared memory"));
            }
            continue;
        };
        match ProcessState::from_number(now.state) {
            Some(ProcessState::Running | ProcessState::Finished) => {
                output::line(&format!("{name}: restarted, process {}", now.pid))?;
                return Ok(());
            }
            Some(ProcessState::Failed | ProcessState::Backoff) => return Err(anyhow::anyhow!("{name} does not start: {}", now.note)),
            _ if Instant::now() > deadline => return Err(anyhow::anyhow!("{name} has started and does not work yet: {}", now.note)),
            _ => {}
        }
    }
}

fn no_response(deployment: &str) -> anyhow::Error {
    anyhow::anyhow!("the supervisor of {deployment} does not respond")
}

/// The process, if the supervisor would restart it.
fn restartable(status: &DeploymentStatus, name: &str) -> Result<ProcessStatus, BadInput> {
    let found = *process(status, name).ok_or_else(|| BadInput(format!("{name} is no process of {}", status.deployment)))?;
    match ProcessState::from_number(found.state) {
        _ if status.ending == 1 => Err(BadInput(format!("deployment {} is ending: nothing is restarted any more", status.deployment))),
        Some(ProcessState::Finished) => {
            Err(BadInput(format!("{name} has finished: its streams have ended, and it has nothing left to do")))
        }
        Some(ProcessState::Waiting) => Err(BadInput(format!("{name} has not been started yet"))),
        _ => Ok(found),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use messages::Text;

    #[test]
    fn what_ends_waits_or_has_finished_is_not_restartable() {
        let status = |state: ProcessState, ending| {
            let mut status = DeploymentStatus { deployment: Text::new("x"), count: 1, ending, ..DeploymentStatus::default() };
            status.processes[0] = ProcessStatus { process: Text::new("std"), state: state as u32, ..ProcessStatus::default() };
            status
        };
        for state in [ProcessState::Starting, ProcessState::Running, ProcessState::Backoff, ProcessState::Failed] {
            assert!(restartable(&status(state, 0), "std").is_ok(), "{state:?}");
            assert!(restartable(&status(state, 1), "std").is_err(), "{state:?} at the end");
        }
        for state in [ProcessState::Waiting, ProcessState::Finished] {
            assert!(restartable(&status(state, 0), "std").is_err(), "{state:?}");
        }
        assert!(restartable(&status(ProcessState::Running, 0), "fti").is_err());
    }
}
