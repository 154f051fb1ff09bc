//! What goes into the state machine and what comes out of it.

use crate::lifecycle::Exit;
use std::path::PathBuf;
use std::time::Duration;

/// What the supervisor learns.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Event {
    /// A process gave a sign of life; `work` is how far it has come in its numbered inputs.
    Heartbeat {
        /// Its place in the start order.
        process: usize,
        /// The last numbers that it has taken, added up.
        work: u64,
        /// It has published everything.
        ending: bool,
    },
    /// The child of a process is gone and has been waited for.
    Exited {
        /// Its place in the start order.
        process: usize,
        /// How.
        exit: Exit,
    },
    /// Files of the domain were removed, or its memory is found to be broken: no process can join.
    DomainLost,
    /// The domain has been made anew.
    Rebuilt,
    /// Time has passed.
    Tick,
    /// The supervisor has not looked for a while, and received nothing.
    StoodStill(Standstill),
    /// A process is to be restarted on request.
    RestartAsked {
        /// Its place in the start order.
        process: usize,
    },
    /// The run is to end: in order at first, with more force at every further request.
    StopAsked,
}

/// What the supervisor does.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Action {
    /// Start a child for a process that has none.
    Spawn {
        /// Its place in the start order.
        process: usize,
        /// 0 for its first child, one more for each further.
        incarnation: u32,
    },
    /// Ask the child to stop (SIGTERM).
    Terminate(usize),
    /// Kill the child (SIGKILL).
    Kill(usize),
    /// Wipe the domain and make it anew: nothing lives in it now.
    Rebuild,
    /// Tell people.
    Tell(Notice),
}

/// What people want to know.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Notice {
    /// A process gave its first sign of life.
    Up {
        /// Its place in the start order.
        process: usize,
    },
    /// A child died and another follows.
    Restarting {
        /// Its place in the start order.
        process: usize,
        /// Why it died.
        cause: String,
        /// Until the next start.
        after: Duration,
    },
    /// A process is restarted on request.
    RestartRequested {
        /// Its place in the start order.
        process: usize,
    },
    /// A child hangs and is killed.
    Hangs {
        /// Its place in the start order.
        process: usize,
        /// How it shows.
        cause: String,
    },
    /// A process ended as it should.
    Finished {
        /// Its place in the start order.
        process: usize,
    },
    /// A process is down for good.
    Failed {
        /// Its place in the start order.
        process: usize,
        /// Why.
        cause: String,
    },
    /// The run ends.
    Ends(Ending),
    /// What is being finished moves on without end; it is stopped.
    Restless {
        /// Since the run began to end.
        after: Duration,
    },
    /// The shared memory is broken; everything starts again.
    Rebuilds,
    /// A file of the domain was removed.
    Removed {
        /// The file or folder.
        path: PathBuf,
    },
    /// The supervisor has not looked for a while.
    StoodStill(Standstill),
    /// Messages did not arrive, or are missing in the log.
    Lost {
        /// Its place in the start order.
        process: usize,
        /// How many so far, parts of the log included.
        count: u64,
    },
    /// The disk of the output folder is nearly full.
    DiskLow {
        /// The folder.
        path: PathBuf,
        /// What is left, MB.
        free_mb: u64,
    },
}

/// Time in which the supervisor did not look.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Standstill {
    /// It did not run while the computer did.
    Stopped(Duration),
    /// The computer was suspended.
    Suspended(Duration),
}

/// Why a run ends.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Ending {
    /// A process that ends the run has finished.
    Complete,
    /// Every process is down.
    NothingLeft,
    /// It was asked to.
    Asked,
    /// It was asked until everything was killed.
    Forced,
    /// A process refused its input.
    BadInput {
        /// Its place in the start order.
        process: usize,
    },
    /// A process that the run cannot do without has failed.
    Lost {
        /// Its place in the start order.
        process: usize,
    },
    /// The shared memory broke more often than the budget allows.
    DomainBroken,
}
