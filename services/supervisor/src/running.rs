//! What is asked of a run, what it tells, how it can fail.

use bus::{BusError, DomainError};
use messages::{DeploymentStatus, MapSummary};
use settings::DocumentError;
use std::io;
use std::path::PathBuf;

/// How to run a deployment.
#[derive(Debug, Clone, PartialEq)]
pub struct Options {
    /// Deployment seconds that pass in a second of the wall clock.
    pub speed: f64,
    /// The `stillmap` executable: `process KIND` runs a built-in process, `guard FOLDER` runs [`crate::guard()`]. With
    /// `/proc/self/exe` that is the file that the supervisor runs, whatever has taken its name since.
    pub executable: PathBuf,
    /// Where the state of the processes outlives the deployment, so that the next start resumes it; nowhere when not given.
    pub state: Option<PathBuf>,
    /// What is there is put aside, and a new run begins.
    pub fresh: bool,
    /// Files of the output folder that the processes read, with their contents. They are written once the folder is locked.
    pub files: Vec<(PathBuf, String)>,
}

/// What happens while a deployment runs.
#[derive(Debug, Clone, Copy)]
pub enum Report<'a> {
    /// The state of all processes; once a second and when something has changed.
    Status(&'a DeploymentStatus),
    /// The map is finished.
    Map(&'a MapSummary),
}

/// A deployment that could not be run.
#[derive(Debug, thiserror::Error)]
pub enum RunError {
    /// The settings cannot be handed to the processes.
    #[error("{0}")]
    Settings(#[from] DocumentError),
    /// The domain is taken or cannot be made.
    #[error("{0}")]
    Domain(#[from] DomainError),
    /// A file of the output folder cannot be written.
    #[error("{}: cannot be written: {source}", path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// The reason.
        source: io::Error,
    },
    /// Another command holds the folder for outputs.
    #[error("{out}: another run of stillmap writes into this folder")]
    OutputTaken {
        /// The folder.
        out: PathBuf,
    },
    /// The kernel, or the sandbox that a container puts in front of it, lacks a system call.
    #[error("{call}: {source}: stillmap needs Linux 5.4 or newer, and a container that allows this system call")]
    Kernel {
        /// The system call.
        call: &'static str,
        /// What the system says.
        source: io::Error,
    },
    /// A process may not open as many files as it needs.
    #[error(
        "a process may open {limit} files (ulimit -n), expected at least {needed}: raise the hard limit (ulimit -Hn, LimitNOFILE=, docker run --ulimit nofile=)"
    )]
    OpenFiles {
        /// The limit that cannot be raised.
        limit: u64,
        /// What the deployment needs.
        needed: u64,
    },
    /// The supervisor's own use of the bus failed.
    #[error("{0}")]
    Bus(#[from] BusError),
    /// The system refused.
    #[error("{what}: {source}")]
    System {
        /// What was wanted.
        what: &'static str,
        /// What it says.
        source: io::Error,
    },
}
