//! A running deployment as its supervisor reports it.

use bus::{Reader, Received, RunningDomain};
use messages::{DeploymentStatus, ProcessStatus};
use runtime::Observer;
use std::time::{Duration, Instant};

/// How long to wait for a status of a supervisor, which publishes one a second.
pub(crate) const PATIENCE: Duration = Duration::from_secs(3);
/// How often a join is tried again.
const JOIN_PERIOD: Duration = Duration::from_millis(50);

/// The statuses of a running deployment.
pub(crate) struct Observed {
    pub(crate) observer: Observer,
    statuses: Reader<DeploymentStatus>,
}

impl Observed {
    /// Joins a deployment. While its supervisor makes its shared memory anew, as after files of it were removed, it cannot be joined.
    pub(crate) fn join(domain: &RunningDomain) -> anyhow::Result<Self> {
        let since = Instant::now();
        loop {
            let joined = Observer::join(domain).map_err(anyhow::Error::from).and_then(|mut observer| {
                let statuses = observer.reader()?;
                Ok(Self { observer, statuses })
            });
            if joined.is_ok() || since.elapsed() > PATIENCE {
                return joined;
            }
            std::thread::park_timeout(JOIN_PERIOD);
        }
    }

    /// The newest status that waits.
    pub(crate) fn take(&mut self) -> anyhow::Result<Option<DeploymentStatus>> {
        let mut newest = None;
        while let Some(received) = self.statuses.take()? {
            if let Received::Message(status) = received {
                newest = Some(*status);
            }
        }
        Ok(newest)
    }

    /// Waits for a status; `None` if the supervisor does not respond.
    pub(crate) fn next(&mut self) -> anyhow::Result<Option<DeploymentStatus>> {
        let since = Instant::now();
        loop {
            match self.take()? {
                Some(status) => return Ok(Some(status)),
                None if since.elapsed() > PATIENCE => return Ok(None),
                None => self.observer.wait(Duration::from_millis(50))?,
            }
        }
    }
}

/// The newest status of each deployment; `None` if its supervisor is stopped or hangs.
pub(crate) fn statuses(domains: &[RunningDomain]) -> anyhow::Result<Vec<(&RunningDomain, Option<DeploymentStatus>)>> {
    let mut queries = Vec::new();
    for domain in domains {
        queries.push((domain, Observed::join(domain)?, None));
    }
    let since = Instant::now();
    loop {
        for (_, observed, newest) in &mut queries {
            *newest = observed.take()?.or(*newest);
        }
        match queries.iter().find(|(_, _, newest)| newest.is_none()) {
            Some((_, observed, _)) if since.elapsed() < PATIENCE => observed.observer.wait(Duration::from_millis(50))?,
            _ => return Ok(queries.into_iter().map(|(domain, _, newest)| (domain, newest)).collect()),
        }
    }
}

/// The process of this name in a status.
pub(crate) fn process<'s>(status: &'s DeploymentStatus, name: &str) -> Option<&'s ProcessStatus> {
    status.processes().iter().find(|it| it.process.as_str() == name)
}
