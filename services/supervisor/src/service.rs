//! What a service manager is told (sd_notify(3)): that the deployment runs, that its supervisor is alive, that it ends.

use crate::deployment::Deployment;
use crate::lifecycle::State;
use sd_notify::NotifyState;

/// The service manager that has started this supervisor, if one has.
#[derive(Debug)]
pub(crate) struct ServiceManager {
    has_watchdog: bool,
    status: String,
    is_ready: bool,
    is_stopping: bool,
}

impl ServiceManager {
    pub(crate) fn of_this_process() -> Self {
        Self { has_watchdog: sd_notify::watchdog_enabled().is_some(), status: String::new(), is_ready: false, is_stopping: false }
    }

    /// Reports that the supervisor is alive. To be called once a second from its loop; the unit file allows it 30 s.
    pub(crate) fn alive(&self) {
        if self.has_watchdog {
            send(&[NotifyState::Watchdog]);
        }
    }

    /// Reports the state of the deployment where it has changed. It is ready when every process has been started.
    pub(crate) fn report(&mut self, deployment: &Deployment) {
        let processes = deployment.processes();
        let running = processes.iter().filter(|it| matches!(it.state(), State::Running { .. })).count();
        let status = format!("{running} of {} processes at work", processes.len());
        if status != self.status {
            send(&[NotifyState::Status(&status)]);
            self.status = status;
        }
        let is_starting = processes.iter().any(|it| matches!(it.state(), State::Waiting | State::Starting { .. }));
        if !self.is_ready && !is_starting {
            self.is_ready = true;
            send(&[NotifyState::Ready]);
        }
        if !self.is_stopping && deployment.ending().is_some() {
            self.is_stopping = true;
            send(&[NotifyState::Stopping]);
        }
    }
}

/// Without a service manager there is no socket, and nothing to do.
fn send(state: &[NotifyState<'_>]) {
    if let Err(error) = sd_notify::notify(state) {
        tracing::debug!("the service manager cannot be told: {error}");
    }
}
