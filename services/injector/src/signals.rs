//! The hand that disturbs a process: signals and limits.

use std::io;

use rustix::process::{Pid, PidfdFlags, Resource, Rlimit, Signal, getrlimit, pidfd_open, pidfd_send_signal, prlimit};

use crate::timetable::Harm;

/// A process that could not be disturbed.
#[derive(Debug, thiserror::Error)]
pub enum SignalError {
    /// It is gone, or it is none of the deployment's.
    #[error("process {pid} is none of this deployment's")]
    Stranger {
        /// Its id.
        pid: u32,
    },
    /// The system refuses.
    #[error("process {pid}: {source}")]
    System {
        /// Its id.
        pid: u32,
        /// What the system says.
        source: io::Error,
    },
}

/// A process of a deployment that may be disturbed.
#[derive(Debug)]
pub struct Victim {
    pid: Pid,
    /// Number of the process, as people see it.
    number: u32,
    handle: rustix::fd::OwnedFd,
}

impl Victim {
    /// The process of this id, if it is a child of the deployment's supervisor: an id may have gone to another process.
    ///
    /// # Errors
    /// When it is not, or is gone.
    pub fn find(supervisor: u32, pid: u32) -> Result<Self, SignalError> {
        let stranger = || SignalError::Stranger { pid };
        let raw = i32::try_from(pid).ok().and_then(Pid::from_raw).ok_or_else(stranger)?;
        let handle = pidfd_open(raw, PidfdFlags::empty()).map_err(|_| stranger())?;
        // Asked after the handle is held: from now on it is this process or none.
        let parent = std::fs::read_to_string(format!("/proc/{pid}/stat")).ok().and_then(|stat| parent_of(&stat));
        if parent == Some(supervisor) { Ok(Self { pid: raw, number: pid, handle }) } else { Err(stranger()) }
    }

    /// Does it.
    ///
    /// # Errors
    /// When the system refuses, or the process is gone.
    pub fn suffer(&self, harm: Harm) -> Result<(), SignalError> {
        match harm {
            Harm::Kill => self.signal(Signal::KILL),
            Harm::Stop => self.signal(Signal::STOP),
            Harm::Continue => self.signal(Signal::CONT),
            Harm::FillDisk => self.limit_files(Some(self.largest_file())),
            Harm::FreeDisk => self.limit_files(None),
        }
    }

    fn signal(&self, signal: Signal) -> Result<(), SignalError> {
        pidfd_send_signal(&self.handle, signal).map_err(|error| self.refused(error.into()))
    }

    /// Lets no file of it grow beyond `bytes`. Shared memory is files, too, so that the limit is the size of what it writes.
    fn limit_files(&self, bytes: Option<u64>) -> Result<(), SignalError> {
        let maximum = getrlimit(Resource::Fsize).maximum;
        let limit = Rlimit { current: bytes.or(maximum), maximum };
        prlimit(Some(self.pid), Resource::Fsize, limit).map(|_| ()).map_err(|error| self.refused(error.into()))
    }

    /// Size of the largest file on a disk that it has open.
    fn largest_file(&self) -> u64 {
        let open = std::fs::read_dir(format!("/proc/{}/fd", self.number)).into_iter().flatten().flatten();
        let on_disk = open.filter(|entry| std::fs::read_link(entry.path()).is_ok_and(|target| !target.starts_with("/dev/shm")));
        on_disk.filter_map(|entry| std::fs::metadata(entry.path()).ok()).filter(|it| it.is_file()).map(|it| it.len()).max().unwrap_or(0)
    }

    fn refused(&self, source: io::Error) -> SignalError {
        SignalError::System { pid: self.number, source }
    }
}

/// Field 4 of `/proc/<pid>/stat`, see proc(5).
fn parent_of(stat: &str) -> Option<u32> {
    // The program's name stands in brackets and may hold anything.
    stat.get(stat.rfind(')')? + 1..)?.split_ascii_whitespace().nth(1)?.parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::os::unix::process::ExitStatusExt;
    use std::process::{Command, Stdio};

    #[test]
    fn a_child_is_killed_and_a_stranger_is_not() {
        let mut child = Command::new("cat").stdin(Stdio::piped()).stdout(Stdio::null()).spawn().unwrap();
        let victim = Victim::find(std::process::id(), child.id()).unwrap();
        victim.suffer(Harm::Stop).unwrap();
        victim.suffer(Harm::Continue).unwrap();
        victim.suffer(Harm::FillDisk).unwrap();
        victim.suffer(Harm::FreeDisk).unwrap();
        victim.suffer(Harm::Kill).unwrap();
        assert_eq!(child.wait().unwrap().signal(), Some(9));
        assert!(matches!(Victim::find(std::process::id(), child.id()), Err(SignalError::Stranger { .. })));
        assert!(matches!(Victim::find(std::process::id(), 1), Err(SignalError::Stranger { .. })));
    }

    #[test]
    fn a_name_with_brackets_is_a_name() {
        assert_eq!(parent_of("12 (a) b) S 7 12 12 0"), Some(7));
        assert_eq!(parent_of("12 (a"), None);
    }
}
