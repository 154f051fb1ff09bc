//! The status of a running deployment, as its supervisor publishes it.

use std::path::Path;
use std::time::Duration;

use bus::{Reader, Received, RunningDomain};
use messages::DeploymentStatus;

/// A reader of one deployment's status.
pub(crate) struct Observer {
    statuses: Reader<DeploymentStatus>,
    inputs: runtime::Observer,
}

impl Observer {
    /// Joins the deployment of this name in a runtime folder, or the only one there; `None` while it does not run yet.
    pub(crate) fn join(runtime: &Path, deployment: Option<&str>) -> Option<Self> {
        let running = RunningDomain::all_in(runtime);
        let domain = running.iter().find(|domain| deployment.is_none_or(|name| name == domain.name()))?;
        let mut inputs = runtime::Observer::join(domain).ok()?;
        let statuses = inputs.reader().ok()?;
        Some(Self { statuses, inputs })
    }

    /// The statuses that have come, after at most `within` without any.
    pub(crate) fn take(&mut self, within: Duration) -> Vec<DeploymentStatus> {
        let mut taken = self.take_now();
        if taken.is_empty() {
            self.inputs.wait(within).unwrap();
            taken = self.take_now();
        }
        taken
    }

    fn take_now(&mut self) -> Vec<DeploymentStatus> {
        let mut taken = Vec::new();
        while let Some(received) = self.statuses.take().unwrap() {
            if let Received::Message(status) = received {
                taken.push(*status);
            }
        }
        taken
    }
}
