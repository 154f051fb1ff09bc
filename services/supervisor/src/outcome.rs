//! How a run ended, and what its exit code says.

use crate::deployment::Deployment;
use crate::events::Ending;
use crate::lifecycle::State;
use messages::MapSummary;

/// Exit code of a run that ended while a process had failed for good, or whose results are incomplete.
pub const EXIT_INCOMPLETE: u8 = 3;

/// A run that has ended.
#[derive(Debug, Clone, PartialEq)]
pub struct Outcome {
    /// Why it ended.
    pub ending: Ending,
    /// The processes in start order.
    pub processes: Vec<ProcessOutcome>,
    /// The finished map in numbers, when one was published.
    pub map: Option<MapSummary>,
}

/// What became of a process.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ProcessOutcome {
    /// Its name.
    pub name: String,
    /// Times it was started again.
    pub restarts: u32,
    /// Why it failed for good, if it did.
    pub failure: Option<String>,
}

impl Outcome {
    pub(crate) fn of(deployment: &Deployment, map: Option<MapSummary>) -> Self {
        let outcome = |it: &crate::Lifecycle| ProcessOutcome {
            name: it.plan().name.clone(),
            restarts: it.restarted(),
            failure: (*it.state() == State::Failed).then(|| it.cause().to_owned()),
        };
        Self {
            ending: deployment.ending().unwrap_or(Ending::NothingLeft),
            processes: deployment.processes().iter().map(outcome).collect(),
            map,
        }
    }

    /// The processes that failed for good, with why.
    pub fn failures(&self) -> impl Iterator<Item = (&str, &str)> {
        self.processes.iter().filter_map(|it| Some((it.name.as_str(), it.failure.as_deref()?)))
    }

    /// The exit code of the command that supervised the run.
    ///
    /// | code | means |
    /// | --- | --- |
    /// | 0 | the run ended well, by itself or on a signal (SIGINT, SIGTERM, SIGHUP) on which everything stopped in order |
    /// | 1 | the supervisor itself failed, or the shared memory kept breaking |
    /// | 2 | settings, world or log cannot be used |
    /// | 3 | the run ended, but a process had failed for good or had to be killed |
    /// | 130 | further signals killed everything |
    #[must_use]
    pub fn exit_code(&self) -> u8 {
        match self.ending {
            Ending::Forced => 130,
            Ending::DomainBroken => 1,
            Ending::BadInput { .. } => 2,
            Ending::Lost { .. } => EXIT_INCOMPLETE,
            Ending::Complete | Ending::NothingLeft | Ending::Asked if self.failures().next().is_some() => EXIT_INCOMPLETE,
            Ending::Complete | Ending::NothingLeft | Ending::Asked => 0,
        }
    }
}
