//! The life of one process, as the supervisor steers it.

use crate::policy::{Policy, Restarts};
use messages::ProcessState;
use std::time::Duration;

/// What a process does in the deployment; decides how a run ends.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Role {
    /// Brings the world in: it is asked to stop when the run ends.
    Source,
    /// Lives on what others publish: it ends by itself once its inputs have ended.
    Consumer,
}

/// A process of the deployment.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Plan {
    /// Its name, unique in the deployment.
    pub name: String,
    /// What it does.
    pub role: Role,
    /// The run ends when it finishes.
    pub ends_run: bool,
    /// Without it the run has no sense: when it fails for good, the run ends.
    pub essential: bool,
}

/// How a child ended.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Exit {
    /// By itself, with success.
    Finished,
    /// It refuses its settings, world or log: starting it again cannot help.
    BadInput,
    /// It found the shared memory of the deployment unusable.
    BrokenDomain,
    /// With another exit code.
    Code(i32),
    /// With another exit code, after a line that says why.
    Error {
        /// The exit code.
        code: i32,
        /// Its last error.
        message: String,
    },
    /// By a signal.
    Signal(i32),
    /// It could not be started; the system's words.
    NotStarted(String),
}

impl std::fmt::Display for Exit {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Finished => write!(f, "finished"),
            Self::BadInput => write!(f, "refused its input"),
            Self::BrokenDomain => write!(f, "found the shared memory broken"),
            Self::Code(code) => write!(f, "ended with exit code {code}"),
            Self::Error { code, message } => write!(f, "ended with exit code {code}: {message}"),
            // Memory that is mapped and not available: nearly always shared memory that is used up.
            Self::Signal(7) => write!(f, "was killed by signal 7 (bus error), as happens to a process that writes when /dev/shm is full"),
            Self::Signal(1) => write!(f, "was told to stop (SIGHUP), not by the supervisor"),
            Self::Signal(2) => write!(f, "was told to stop (SIGINT), not by the supervisor"),
            Self::Signal(15) => write!(f, "was told to stop (SIGTERM), not by the supervisor"),
            Self::Signal(number) => write!(f, "was killed by signal {number}"),
            Self::NotStarted(why) => write!(f, "could not be started: {why}"),
        }
    }
}

/// Where in its life a process is; times are on the supervisor's clock.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum State {
    /// Its turn to start has not come.
    Waiting,
    /// A child runs and has given no sign of life.
    Starting {
        /// When it should have.
        deadline: Duration,
    },
    /// A child runs.
    Running {
        /// Its last heartbeat.
        last_heartbeat: Duration,
    },
    /// A child hung or is replaced on request, and was killed; its exit is still to come.
    Killed,
    /// No child; the next one starts later.
    Backoff {
        /// When.
        until: Duration,
    },
    /// A child was asked to stop.
    Stopping {
        /// When stronger means are due.
        deadline: Duration,
        /// The strongest means was used.
        killed: bool,
    },
    /// Ended as it should.
    Finished,
    /// Down for good.
    Failed,
}

/// One process: its plan, its state, its restarts.
#[derive(Debug, Clone)]
pub struct Lifecycle {
    pub(crate) plan: Plan,
    pub(crate) state: State,
    pub(crate) restarts: Restarts,
    /// Children started so far.
    pub(crate) starts: u32,
    /// How far it has come in its numbered inputs, by its last heartbeat.
    pub(crate) work: u64,
    /// The error that its last child ended with, and how far that had come.
    pub(crate) last_error: Option<(Exit, u64)>,
    /// Why it is down or was killed.
    pub(crate) cause: String,
    /// Its child was killed for a requested restart, which counts for no budget.
    pub(crate) restart_requested: bool,
}

impl Lifecycle {
    pub(crate) fn new(plan: Plan, seed: u64) -> Self {
        Self {
            plan,
            state: State::Waiting,
            restarts: Restarts::new(seed),
            starts: 0,
            work: 0,
            last_error: None,
            cause: String::new(),
            restart_requested: false,
        }
    }

    /// Whether a child of it runs.
    #[must_use]
    pub fn is_live(&self) -> bool {
        matches!(self.state, State::Starting { .. } | State::Running { .. } | State::Killed | State::Stopping { .. })
    }

    /// Whether it is down for good.
    #[must_use]
    pub fn is_over(&self) -> bool {
        matches!(self.state, State::Finished | State::Failed)
    }

    /// Where in its life it is.
    #[must_use]
    pub fn state(&self) -> &State {
        &self.state
    }

    /// Its plan.
    #[must_use]
    pub fn plan(&self) -> &Plan {
        &self.plan
    }

    /// Times it was started again.
    #[must_use]
    pub fn restarted(&self) -> u32 {
        self.starts.saturating_sub(1)
    }

    /// Why it is down; empty while there is nothing to say.
    #[must_use]
    pub fn cause(&self) -> &str {
        &self.cause
    }

    /// Its state in the words of the bus.
    #[must_use]
    pub fn process_state(&self) -> ProcessState {
        match self.state {
            State::Waiting => ProcessState::Waiting,
            State::Starting { .. } => ProcessState::Starting,
            State::Running { .. } => ProcessState::Running,
            State::Killed | State::Stopping { .. } => ProcessState::Stopping,
            State::Backoff { .. } => ProcessState::Backoff,
            State::Finished => ProcessState::Finished,
            State::Failed => ProcessState::Failed,
        }
    }

    /// When the supervisor has to look at it again without an event.
    #[must_use]
    pub fn due(&self, policy: &Policy) -> Option<Duration> {
        match self.state {
            State::Starting { deadline } | State::Stopping { deadline, .. } => Some(deadline),
            State::Running { last_heartbeat } => Some(last_heartbeat + policy.heartbeat_timeout),
            State::Backoff { until } => Some(until),
            State::Waiting | State::Killed | State::Finished | State::Failed => None,
        }
    }

    /// Notes how a child ended; whether it is the same error at the same place as that of the child before. What a kill, a stop or a
    /// hang interrupted may succeed the next time. So may a source without numbered inputs: its device may be back.
    pub(crate) fn repeats(&mut self, exit: &Exit) -> bool {
        let is_error = match exit {
            Exit::NotStarted(_) => true,
            Exit::Error { .. } => self.plan.role == Role::Consumer,
            _ => false,
        };
        let error = is_error.then(|| (exit.clone(), self.work));
        let repeats = error.is_some() && error == self.last_error;
        self.last_error = error;
        repeats
    }

    /// Why a child of it has to be killed now, if so.
    pub(crate) fn hangs(&self, policy: &Policy, now: Duration) -> Option<String> {
        match self.state {
            State::Starting { deadline } if now >= deadline => {
                Some(format!("gave no sign of life within {:.1} s of its start", policy.startup_deadline.as_secs_f64()))
            }
            State::Running { last_heartbeat } if now >= last_heartbeat + policy.heartbeat_timeout => {
                Some(format!("gave no sign of life for {:.1} s", (now - last_heartbeat).as_secs_f64()))
            }
            _ => None,
        }
    }
}
