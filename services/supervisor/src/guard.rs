//! The guard: a process that outlives a killed supervisor just long enough to clean up after it.
//!
//! It holds the reading end of a pipe whose writing end only the supervisor holds. When that closes, the supervisor is gone,
//! and its children with it. What these had started is killed, by the process groups that the supervisor told of over the pipe:
//! a line `+PID` for a child that has come, `-PID` for one that goes, and what has left these by their environment. Then what is left of the domain in shared memory and on disk
//! is removed.

use crate::executable::own_command;
use crate::leftovers::{self, Origin, kill_descendants};
use rustix::process::{Pid, Signal, kill_process_group};
use std::collections::BTreeSet;
use std::io::{self, BufRead, Write};
use std::os::fd::{AsFd, BorrowedFd};
use std::os::unix::process::CommandExt;
use std::path::Path;
use std::process::{ChildStdin, Stdio};

/// Waits on standard input for the death of the supervisor, then kills what its children left and removes what is left of the domain
/// at `directory`.
///
/// # Errors
/// When standard input cannot be read or the domain cannot be removed.
pub fn guard(directory: &Path) -> Result<(), GuardError> {
    for group in groups_at_the_end(io::stdin().lock())?.into_iter().filter_map(Pid::from_raw) {
        // Fails when no process is left in it.
        let _ = kill_process_group(group, Signal::KILL);
    }
    kill_descendants(Origin { domain: directory, process: None });
    // After an orderly end nothing is left, and the next supervisor may already be there; but not without the folder of all domains.
    let is_left = directory.exists() || !directory.parent().is_some_and(Path::exists);
    if is_left { Ok(bus::sweep(directory)?) } else { Ok(()) }
}

/// Reads to the end which groups come and go; those that have not gone. What is no such line says nothing.
fn groups_at_the_end(lines: impl BufRead) -> io::Result<BTreeSet<i32>> {
    let mut groups = BTreeSet::new();
    for line in lines.split(b'\n') {
        let line = line?;
        let group = || std::str::from_utf8(line.get(1..)?).ok()?.parse().ok().filter(|pid| *pid > 1);
        match (line.first(), group()) {
            (Some(b'+'), Some(group)) => groups.insert(group),
            (Some(b'-'), Some(group)) => groups.remove(&group),
            _ => false,
        };
    }
    Ok(groups)
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
    /// Gone when it is not to be trusted any more.
    pipe: Option<ChildStdin>,
}

impl Guard {
    /// Starts a guard; it lives on when this process dies.
    pub(crate) fn start(executable: &Path, directory: &Path) -> io::Result<Self> {
        let mut command = own_command(executable);
        command.arg("guard").arg(directory).stdin(Stdio::piped()).stdout(Stdio::null()).process_group(0);
        // A process of another deployment may have started this one; the guard is none of its own that end with it.
        command.env_remove(leftovers::DOMAIN);
        let mut child = command.spawn()?;
        let pipe = child.stdin.take();
        let mut guard = Self { child, pipe };
        // A guard that does not read must not hold up the supervisor.
        if guard.pipe.as_ref().is_none_or(|pipe| rustix::io::ioctl_fionbio(pipe, true).is_err()) {
            guard.distrust();
        }
        Ok(guard)
    }

    /// Where it is told.
    pub(crate) fn pipe(&self) -> Option<BorrowedFd<'_>> {
        self.pipe.as_ref().map(AsFd::as_fd)
    }

    /// Tells that the child of this process id, and group, has come.
    pub(crate) fn take(&mut self, pid: u32) {
        self.tell(&format!("+{pid}\n"));
    }

    /// Tells that the child of this process id goes; before it is waited for, since the number may be another's then.
    pub(crate) fn give_up(&mut self, pid: u32) {
        self.tell(&format!("-{pid}\n"));
    }

    fn tell(&mut self, line: &str) {
        // A line is written whole or not at all.
        if self.pipe.as_mut().is_some_and(|pipe| pipe.write_all(line.as_bytes()).is_err()) {
            self.distrust();
        }
    }

    /// Kills a guard that may know of the wrong groups: it must not see the pipe close.
    pub(crate) fn distrust(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
        self.pipe = None;
    }

    /// Its process id.
    pub(crate) fn pid(&self) -> u32 {
        self.child.id()
    }

    /// Whether it is still there.
    pub(crate) fn is_alive(&mut self) -> bool {
        matches!(self.child.try_wait(), Ok(None))
    }

    /// Lets it go and waits for its end: nothing of this run outlives it.
    pub(crate) fn dismiss(mut self) {
        self.pipe = None;
        let _ = self.child.wait();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn left(lines: &[u8]) -> Vec<i32> {
        groups_at_the_end(lines).unwrap().into_iter().collect()
    }

    #[test]
    fn what_came_and_did_not_go_is_left() {
        assert_eq!(left(b"+12\n+7\n-12\n+13\n"), [7, 13]);
        assert_eq!(left(b"+12\n-12\n+12\n"), [12], "its number is there again");
        assert_eq!(left(b"-12\n+12"), [12]);
        assert_eq!(left(b""), Vec::<i32>::new());
    }

    #[test]
    fn lines_that_name_no_child_kill_nothing() {
        assert_eq!(left(b"+0\n+1\n+-5\n+\n\n+99999999999\n12\n+\xff\n +4\n+5x\n"), Vec::<i32>::new());
    }
}
