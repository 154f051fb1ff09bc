//! The guard: a process that outlives a killed supervisor just long enough to clean up after it.
//!
//! It holds the reading end of a pipe whose writing end only the supervisor holds. When that closes, the supervisor is gone,
//! and its children with it; what is left of the domain in shared memory and on disk is removed.

use std::io::{self, Read};
use std::os::unix::process::CommandExt;
use std::path::Path;
use std::process::{ChildStdin, Command, Stdio};

/// Waits on standard input for the death of the supervisor, then removes what it left in the domain at `directory`.
///
/// # Errors
/// When standard input cannot be read or the domain cannot be removed.
pub fn guard(directory: &Path) -> Result<(), GuardError> {
    let mut nothing = [0; 64];
    loop {
        match io::stdin().read(&mut nothing) {
            Ok(0) => break,
            Ok(_) => {}
            Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
            Err(error) => return Err(error.into()),
        }
    }
    // After an orderly end nothing is left, and the next supervisor may already be there.
    if directory.exists() { Ok(bus::sweep(directory)?) } else { Ok(()) }
}

/// A guard that could not do its work.
#[derive(Debug, thiserror::Error)]
pub enum GuardError {
    /// Standard input cannot be read.
    #[error("standard input: {0}")]
    Input(#[from] io::Error),
    /// The domain cannot be removed.
    #[error("{0}")]
    Domain(#[from] bus::DomainError),
}

/// The supervisor's end of a guard.
#[derive(Debug)]
pub(crate) struct Guard {
    child: std::process::Child,
    _alive: Option<ChildStdin>,
}

impl Guard {
    /// Starts a guard; it lives on when this process dies.
    pub(crate) fn start(executable: &Path, directory: &Path) -> io::Result<Self> {
        let mut command = Command::new(executable);
        command.arg("guard").arg(directory).stdin(Stdio::piped()).stdout(Stdio::null()).process_group(0);
        let mut child = command.spawn()?;
        Ok(Self { _alive: child.stdin.take(), child })
    }

    /// Whether it is still there.
    pub(crate) fn is_alive(&mut self) -> bool {
        matches!(self.child.try_wait(), Ok(None))
    }

    /// Lets it go and waits for its end: nothing of this run outlives it.
    pub(crate) fn dismiss(mut self) {
        self._alive = None;
        let _ = self.child.wait();
    }
}
