//! `health/…`: the state of the processes.

use crate::layout::plain;
use crate::numbered::numbered;
use crate::service::{at_most, within};
use crate::{Invalid, Text};

/// Most input streams in a heartbeat.
///
/// ```
/// use stillmap_messages::{Heartbeat, MAX_INPUTS};
///
/// assert_eq!(Heartbeat::default().inputs.len(), MAX_INPUTS);
/// ```
pub const MAX_INPUTS: usize = 24;
/// Most named counters of a process.
///
/// ```
/// use stillmap_messages::{Heartbeat, MAX_COUNTERS};
///
/// assert_eq!(Heartbeat::default().counters.len(), MAX_COUNTERS);
/// ```
pub const MAX_COUNTERS: usize = 16;
/// Most processes of a deployment.
///
/// ```
/// use stillmap_messages::{DeploymentStatus, MAX_PROCESSES};
///
/// assert_eq!(DeploymentStatus::default().processes.len(), MAX_PROCESSES);
/// ```
pub const MAX_PROCESSES: usize = 24;

numbered! {
    /// The phase of a process.
    ///
    /// ```
    /// use stillmap_messages::{Heartbeat, Phase};
    ///
    /// let heartbeat = Heartbeat { phase: Phase::Running as u32, ..Heartbeat::default() };
    /// assert_eq!(Phase::from_number(heartbeat.phase), Some(Phase::Running));
    /// ```
    pub enum Phase {
        /// It has joined the deployment and does not work yet.
        Starting = 0,
        /// At work.
        Running = 1,
        /// It has published everything and stays while a consumer may need its history.
        Ending = 2,
    }
}

numbered! {
    /// Level of a log line; the numbers are those of Foxglove's `Log`.
    ///
    /// ```
    /// use stillmap_messages::LogLevel;
    ///
    /// assert_eq!(LogLevel::Warning as u32, 3);
    /// ```
    pub enum LogLevel {
        /// Details for finding a fault.
        Debug = 1,
        /// Normal operation.
        Info = 2,
        /// Something is degraded.
        Warning = 3,
        /// Something failed.
        Error = 4,
    }
}

numbered! {
    /// State of a process as the supervisor sees it.
    ///
    /// ```
    /// use stillmap_messages::ProcessState;
    ///
    /// assert_eq!(ProcessState::from_number(6).map(ProcessState::word), Some("failed"));
    /// ```
    pub enum ProcessState {
        /// Not started yet.
        Waiting = 0,
        /// Started, no heartbeat yet.
        Starting = 1,
        /// At work.
        Running = 2,
        /// It died and is restarted after a delay.
        Backoff = 3,
        /// Asked to stop.
        Stopping = 4,
        /// Ended in order.
        Finished = 5,
        /// It died more often than its budget allows and is not restarted.
        Failed = 6,
    }
}

impl ProcessState {
    /// The state as a word.
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
    /// Counters of one input.
    ///
    /// ```
    /// use stillmap_messages::{InputCounters, Text};
    ///
    /// let input = InputCounters { service: Text::new("robot/scan"), received: 97, lost: 3, ..InputCounters::default() };
    /// assert_eq!(input.service.as_str(), "robot/scan");
    /// ```
    pub struct InputCounters {
        /// The service.
        pub service: Text<32>,
        /// Messages received.
        pub received: u64,
        /// Messages missing between those received.
        pub lost: u64,
        /// Messages that were received before.
        pub repeated: u64,
        /// Messages refused: wrong checksum, numbers out of range, time running backwards.
        pub refused: u64,
        /// Last sequence number received.
        pub last_seq: u64,
        /// Median latency of the last messages, from their stamp until they were received, µs; 0 when none was measured.
        pub latency_median_us: u32,
        /// 99th percentile of that latency, µs; 0 when none was measured.
        pub latency_p99_us: u32,
    }

    /// A named counter of a process.
    ///
    /// ```
    /// use stillmap_messages::{Counter, Text};
    ///
    /// let counter = Counter { name: Text::new("bad checksums"), value: 2 };
    /// assert_eq!(counter.name.as_str(), "bad checksums");
    /// ```
    pub struct Counter {
        /// Its name, such as `bad checksums`.
        pub name: Text<32>,
        /// Its value.
        pub value: u64,
    }

    /// A heartbeat from the work loop of a process, with its counters.
    ///
    /// ```
    /// use stillmap_messages::{Heartbeat, Payload, Text};
    ///
    /// let mut heartbeat = Heartbeat { process: Text::new("std"), ..Heartbeat::default() };
    /// assert_eq!(heartbeat.validate(), Ok(()));
    /// heartbeat.inputs_count = 25;
    /// assert_eq!(heartbeat.validate().unwrap_err().to_string(), "inputs_count is 25, expected at most 24");
    /// ```
    pub struct Heartbeat {
        /// Name in the deployment.
        pub process: Text<32>,
        /// A note on its state; may be empty.
        pub note: Text<128>,
        /// Number of steps of its work loop.
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

    /// How far a process has answered its source stream. Playback in lockstep waits for it.
    ///
    /// ```
    /// use stillmap_messages::{Progress, Text};
    ///
    /// let progress = Progress { process: Text::new("std"), service: Text::new("robot/scan"), answered: 41 };
    /// assert_eq!(progress.answered, 41);
    /// ```
    pub struct Progress {
        /// Name in the deployment.
        pub process: Text<32>,
        /// The source stream.
        pub service: Text<32>,
        /// Every message up to this number is answered.
        pub answered: u64,
    }

    /// A line that a process, or the supervisor itself, has logged.
    ///
    /// ```
    /// use stillmap_messages::{LogLevel, LogLine, Payload, Text};
    ///
    /// let line = LogLine { process: Text::new("std"), message: Text::new("resumes"), level: LogLevel::Info as u32, reserved: 0 };
    /// assert_eq!(line.validate(), Ok(()));
    /// ```
    pub struct LogLine {
        /// Name in the deployment; `supervisor` for the supervisor's own.
        pub process: Text<32>,
        /// The text, cut to what fits.
        pub message: Text<480>,
        /// [`LogLevel`] as a number.
        pub level: u32,
        /// Always 0.
        pub reserved: u32,
    }

    /// One process as the supervisor sees it.
    ///
    /// ```
    /// use stillmap_messages::{ProcessState, ProcessStatus};
    ///
    /// let status = ProcessStatus { state: ProcessState::Finished as u32, ..ProcessStatus::default() };
    /// assert!(status.is_over());
    /// ```
    pub struct ProcessStatus {
        /// Name in the deployment.
        pub process: Text<32>,
        /// The note of its last heartbeat, or the reason why it is down.
        pub note: Text<128>,
        /// Milliseconds since its last heartbeat; `u64::MAX` when there was none.
        pub heartbeat_age_ms: u64,
        /// Messages received, all inputs.
        pub received: u64,
        /// Messages lost, all inputs.
        pub lost: u64,
        /// Messages refused, all inputs.
        pub refused: u64,
        /// Messages sent.
        pub sent: u64,
        /// Messages received per second, recently.
        pub received_per_s: f64,
        /// Messages sent per second, recently.
        pub sent_per_s: f64,
        /// Median latency of its busiest input, µs; 0 when none was measured.
        pub latency_median_us: u32,
        /// 99th percentile of the latency of that input, µs; 0 when none was measured.
        pub latency_p99_us: u32,
        /// Share of one core, recently.
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
        /// Number of restarts.
        pub restarts: u32,
    }

    /// The whole deployment as the supervisor sees it.
    ///
    /// ```
    /// use stillmap_messages::{DeploymentStatus, ProcessStatus, Text};
    ///
    /// let mut status = DeploymentStatus { count: 1, ..DeploymentStatus::default() };
    /// status.processes[0] = ProcessStatus { process: Text::new("std"), restarts: 1, ..ProcessStatus::default() };
    /// assert_eq!(status.processes().iter().map(|process| process.restarts).sum::<u32>(), 1);
    /// ```
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

impl Counter {
    /// Counter of the recorder: messages that are missing in the log.
    pub const NOT_RECORDED: &'static str = "messages not recorded";
    /// Counter of the recorder: parts of the log that were removed or truncated.
    pub const PARTS_LOST: &'static str = "log parts lost";
}

impl ProcessStatus {
    /// Whether it has finished or failed for good: it is not restarted.
    #[must_use]
    pub fn is_over(&self) -> bool {
        [ProcessState::Finished, ProcessState::Failed].map(|state| state as u32).contains(&self.state)
    }

    /// Whether it has died and does not work again yet, or is about to work for the first time.
    ///
    /// ```
    /// use stillmap_messages::{ProcessState, ProcessStatus};
    ///
    /// let status = ProcessStatus { state: ProcessState::Backoff as u32, ..ProcessStatus::default() };
    /// assert!(status.is_starting());
    /// ```
    #[must_use]
    pub fn is_starting(&self) -> bool {
        [ProcessState::Starting, ProcessState::Backoff].map(|state| state as u32).contains(&self.state)
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
            within("processes.received_per_s", process.received_per_s, 0.0, 1e9, "0 to 1000000000 messages a second")?;
            within("processes.sent_per_s", process.sent_per_s, 0.0, 1e9, "0 to 1000000000 messages a second")?;
            within("processes.cpu", process.cpu, 0.0, 1e4, "0 to 10000 cores")?;
        }
        Ok(())
    }
}
