//! Actions on a process: signals and limits.

use std::io;

use rustix::process::{Pid, PidfdFlags, Resource, Rlimit, Signal, getrlimit, pidfd_open, pidfd_send_signal, prlimit};

use crate::schedule::ProcessAction;

/// An action on a process failed.
#[derive(Debug, thiserror::Error)]
pub enum TargetError {
    /// It is gone, or it does not belong to the deployment.
    #[error("process {pid} does not belong to this deployment")]
    Foreign {
        /// Its process id.
        pid: u32,
    },
    /// The system reports an error.
    #[error("process {pid}: {source}")]
    System {
        /// Its process id.
        pid: u32,
        /// The error.
        source: io::Error,
    },
}

/// A process of a deployment on which actions are performed.
#[derive(Debug)]
pub struct Target {
    pid: Pid,
    /// The process id as a number.
    number: u32,
    handle: rustix::fd::OwnedFd,
}

impl Target {
    /// The process of this id, if it is a child of the supervisor: the system may have given the id to another process since.
    ///
    /// # Errors
    /// When it is not, or is gone.
    pub fn find(supervisor: u32, pid: u32) -> Result<Self, TargetError> {
        let foreign = || TargetError::Foreign { pid };
        let raw = i32::try_from(pid).ok().and_then(Pid::from_raw).ok_or_else(foreign)?;
        let handle = pidfd_open(raw, PidfdFlags::empty()).map_err(|_| foreign())?;
        // Read after the handle is open, so that the handle is of the process whose parent this is.
        let parent = std::fs::read_to_string(format!("/proc/{pid}/stat")).ok().and_then(|stat| parent_of(&stat));
        if parent == Some(supervisor) { Ok(Self { pid: raw, number: pid, handle }) } else { Err(foreign()) }
    }

    /// Performs an action on the process.
    ///
    /// # Errors
    /// When the system reports an error, or the process is gone.
    pub fn apply(&self, action: ProcessAction) -> Result<(), TargetError> {
        match action {
            ProcessAction::Kill => self.signal(Signal::KILL),
            ProcessAction::Stop => self.signal(Signal::STOP),
            ProcessAction::Continue => self.signal(Signal::CONT),
            ProcessAction::FillDisk => self.limit_files(Some(self.largest_file())),
            ProcessAction::FreeDisk => self.limit_files(None),
        }
    }

    fn signal(&self, signal: Signal) -> Result<(), TargetError> {
        pidfd_send_signal(&self.handle, signal).map_err(|error| self.failed(error.into()))
    }

    /// Limits the size of every file of the process. Shared memory consists of files, too, so that the limit is the size of its
    /// largest file on a disk and not 0.
    fn limit_files(&self, bytes: Option<u64>) -> Result<(), TargetError> {
        let maximum = getrlimit(Resource::Fsize).maximum;
        let limit = Rlimit { current: bytes.or(maximum), maximum };
        prlimit(Some(self.pid), Resource::Fsize, limit).map(|_| ()).map_err(|error| self.failed(error.into()))
    }

    /// Size of the largest file on a disk that the process has open.
    fn largest_file(&self) -> u64 {
        let open = std::fs::read_dir(format!("/proc/{}/fd", self.number)).into_iter().flatten().flatten();
        let on_disk = open.filter(|entry| std::fs::read_link(entry.path()).is_ok_and(|target| !target.starts_with("/dev/shm")));
        on_disk.filter_map(|entry| std::fs::metadata(entry.path()).ok()).filter(|it| it.is_file()).map(|it| it.len()).max().unwrap_or(0)
    }

    fn failed(&self, source: io::Error) -> TargetError {
        TargetError::System { pid: self.number, source }
    }
}

/// Field 4 of `/proc/<pid>/stat`, see proc(5).
fn parent_of(stat: &str) -> Option<u32> {
    // The name of the program stands in brackets and may contain anything.
    stat.get(stat.rfind(')')? + 1..)?.split_ascii_whitespace().nth(1)?.parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::os::unix::process::ExitStatusExt;
    use std::process::{Command, Stdio};

    #[test]
    fn actions_apply_to_children_only() {
        let mut child = Command::new("cat").stdin(Stdio::piped()).stdout(Stdio::null()).spawn().unwrap();
        let target = Target::find(std::process::id(), child.id()).unwrap();
        target.apply(ProcessAction::Stop).unwrap();
        target.apply(ProcessAction::Continue).unwrap();
        target.apply(ProcessAction::FillDisk).unwrap();
        target.apply(ProcessAction::FreeDisk).unwrap();
        target.apply(ProcessAction::Kill).unwrap();
        assert_eq!(child.wait().unwrap().signal(), Some(9));
        assert!(matches!(Target::find(std::process::id(), child.id()), Err(TargetError::Foreign { .. })));
        assert!(matches!(Target::find(std::process::id(), 1), Err(TargetError::Foreign { .. })));
    }

    #[test]
    fn the_parent_is_read_past_brackets_in_the_name() {
        assert_eq!(parent_of("12 (a) b) S 7 12 12 0"), Some(7));
        assert_eq!(parent_of("12 (a"), None);
    }
}
