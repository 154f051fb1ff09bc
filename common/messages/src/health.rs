//! `health/…`: how the processes are.

use crate::layout::plain;
use crate::service::{at_most, within};
use crate::{Invalid, Text};

/// Most input streams that a heartbeat tells of.
pub const MAX_INPUTS: usize = 24;
/// Most named counters of a process.
pub const MAX_COUNTERS: usize = 16;
/// Most processes of a deployment.
pub const MAX_PROCESSES: usize = 24;

/// Where in its life a process is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u32)]
pub enum Phase {
    /// Joined, not yet at work.
    Starting = 0,
    /// At work.
    Running = 1,
    /// It has said all it has to say, and stays while somebody may need it again.
    Ending = 2,
}

/// How much a log line matters; the numbers are those of Foxglove's `Log`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u32)]
pub enum LogLevel {
    /// For who looks for a fault.
    Debug = 1,
    /// What happens in the normal course.
    Info = 2,
    /// Something is degraded.
    Warning = 3,
    /// Something failed.
    Error = 4,
}

/// What the supervisor knows of a process.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u32)]
pub enum ProcessState {
    /// Not started yet.
    Waiting = 0,
    /// Started, no heartbeat yet.
    Starting = 1,
    /// At work.
    Running = 2,
    /// Died; starts again after its delay.
    Backoff = 3,
    /// Asked to stop.
    Stopping = 4,
    /// Ended as it should.
    Finished = 5,
    /// Died more often than its budget allows; stays down.
    Failed = 6,
}

impl ProcessState {
    /// The state a number stands for, if any.
    #[must_use]
    pub fn from_number(number: u32) -> Option<Self> {
        Some(match number {
            0 => Self::Waiting,
            1 => Self::Starting,
            2 => Self::Running,
            3 => Self::Backoff,
            4 => Self::Stopping,
            5 => Self::Finished,
            6 => Self::Failed,
            _ => return None,
        })
    }

    /// The word for people.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::Waiting => "waiting",
            Self::Starting => "starting",
            Self::Running => "running",
            Self::Backoff => "backoff",
            Self::Stopping => "stopping",
            Self::Finished => "finished",
            Self::Failed => "failed",
        }
    }
}

plain! {
    /// What came in on one service.
    pub struct InputCounters {
        /// The service.
        pub service: Text<32>,
        /// Messages taken.
        pub received: u64,
        /// Messages missing between those taken.
        pub lost: u64,
        /// Messages that had been taken before.
        pub repeated: u64,
        /// Messages refused: wrong checksum, numbers out of range, time running backwards.
        pub refused: u64,
        /// Last sequence number taken.
        pub last_seq: u64,
        /// Median of the time from what a message tells of until it was taken, lately, µs; 0 when none was measured.
        pub latency_median_us: u32,
        /// What 99 % of the messages stayed within, µs; 0 when none was measured.
        pub latency_p99_us: u32,
    }

    /// A number that a process counts for people.
    pub struct Counter {
        /// Its name, for example `bad checksums`.
        pub name: Text<32>,
        /// Its value.
        pub value: u64,
    }

    /// A sign of life from the work loop of a process.
    pub struct Heartbeat {
        /// Name in the deployment.
        pub process: Text<32>,
        /// What it is doing or missing, in words; empty when there is nothing to say.
        pub note: Text<128>,
        /// Rounds of its work loop.
        pub progress: u64,
        /// Messages sent.
        pub sent: u64,
        /// Its inputs; the first `inputs_count` are valid.
        pub inputs: [InputCounters; MAX_INPUTS] => inputs_count,
        /// Its counters; the first `counters_count` are valid.
        pub counters: [Counter; MAX_COUNTERS] => counters_count,
        /// Number of inputs.
        pub inputs_count: u32,
        /// Number of counters.
        pub counters_count: u32,
        /// Process id.
        pub pid: u32,
        /// [`Phase`] as a number.
        pub phase: u32,
    }

    /// How far a process has answered its source stream: what lockstep playback waits for.
    pub struct Progress {
        /// Name in the deployment.
        pub process: Text<32>,
        /// The source stream.
        pub service: Text<32>,
        /// Every message up to this one is answered for.
        pub answered: u64,
    }

    /// A line that a process, or the supervisor itself, has logged.
    pub struct LogLine {
        /// Name in the deployment; `supervisor` for the supervisor's own.
        pub process: Text<32>,
        /// What it says, cut to what fits.
        pub message: Text<480>,
        /// [`LogLevel`] as a number.
        pub level: u32,
        /// Always 0.
        pub reserved: u32,
    }

    /// One process as the supervisor sees it.
    pub struct ProcessStatus {
        /// Name in the deployment.
        pub process: Text<32>,
        /// The note of its last heartbeat, or why it is down.
        pub note: Text<128>,
        /// Milliseconds since its last heartbeat; `u64::MAX` when there was none.
        pub heartbeat_age_ms: u64,
        /// Messages taken, all inputs.
        pub received: u64,
        /// Messages lost, all inputs.
        pub lost: u64,
        /// Messages refused, all inputs.
        pub refused: u64,
        /// Messages sent.
        pub sent: u64,
        /// Messages taken a second, lately.
        pub received_per_s: f64,
        /// Messages sent a second, lately.
        pub sent_per_s: f64,
        /// Median latency of its busiest input, µs; 0 when none was measured.
        pub latency_median_us: u32,
        /// What 99 % of the messages of that input stay within, µs; 0 when none was measured.
        pub latency_p99_us: u32,
        /// Share of one core, lately.
        pub cpu: f64,
        /// Resident memory, bytes.
        pub resident_bytes: u64,
        /// Its counters; the first `counters_count` are valid.
        pub counters: [Counter; MAX_COUNTERS] => counters_count,
        /// Number of counters.
        pub counters_count: u32,
        /// Process id; 0 when it is not running.
        pub pid: u32,
        /// [`ProcessState`] as a number.
        pub state: u32,
        /// Times it was started again.
        pub restarts: u32,
    }

    /// The whole deployment as the supervisor sees it.
    pub struct DeploymentStatus {
        /// Name of the deployment.
        pub deployment: Text<64>,
        /// Milliseconds since it was started.
        pub uptime_ms: u64,
        /// Its processes in start order; the first `count` are valid.
        pub processes: [ProcessStatus; MAX_PROCESSES] => count,
        /// Number of processes.
        pub count: u32,
        /// 1 while the deployment is ending.
        pub ending: u32,
    }
}

impl ProcessStatus {
    /// Whether it has finished or failed for good: it is not started again.
    #[must_use]
    pub fn is_over(&self) -> bool {
        [ProcessState::Finished, ProcessState::Failed].map(|state| state as u32).contains(&self.state)
    }
}

impl DeploymentStatus {
    /// The processes in start order.
    #[must_use]
    pub fn processes(&self) -> &[ProcessStatus] {
        self.processes.get(..self.count as usize).unwrap_or_default()
    }
}

impl Heartbeat {
    pub(crate) fn check(&self) -> Result<(), Invalid> {
        at_most("inputs_count", self.inputs_count, MAX_INPUTS, "at most 24")?;
        at_most("counters_count", self.counters_count, MAX_COUNTERS, "at most 16")?;
        at_most("phase", self.phase, 2, "0 to 2")
    }
}

impl Progress {
    pub(crate) fn check(&self) -> Result<(), Invalid> {
        Ok(())
    }
}

impl LogLine {
    pub(crate) fn check(&self) -> Result<(), Invalid> {
        within("level", f64::from(self.level), 1.0, 4.0, "1 to 4")
    }
}

impl DeploymentStatus {
    pub(crate) fn check(&self) -> Result<(), Invalid> {
        at_most("count", self.count, MAX_PROCESSES, "at most 24")?;
        at_most("ending", self.ending, 1, "0 or 1")?;
        for process in &self.processes[..self.count as usize] {
            at_most("processes.state", process.state, 6, "0 to 6")?;
            at_most("processes.counters_count", process.counters_count, MAX_COUNTERS, "at most 16")?;
            within("processes.cpu", process.cpu, 0.0, 1e4, "a share of one core")?;
        }
        Ok(())
    }
}
