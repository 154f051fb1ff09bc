//! Processes as the kernel knows them: children, signals, exits.

use std::collections::BTreeMap;
use std::os::fd::OwnedFd;
use std::time::Instant;

use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::process::{Pid, PidfdFlags, Signal, kill_process, pidfd_open};

use super::WATCHDOG;

/// Between two looks at what the kernel shows in `/proc` but reports to no one.
const LOOK: Timespec = Timespec { tv_sec: 0, tv_nsec: 1_000_000 };

fn pid_of(pid: u32) -> Pid {
    Pid::from_raw(i32::try_from(pid).unwrap()).unwrap()
}

pub(crate) fn signal(pid: u32, signal: Signal) {
    kill_process(pid_of(pid), signal).unwrap();
}

pub(crate) fn kill(pid: u32) {
    signal(pid, Signal::KILL);
}

/// Kills a process that may just have exited; whether it was there.
pub(crate) fn try_kill(pid: u32) -> bool {
    kill_process(pid_of(pid), Signal::KILL).is_ok()
}

/// Stops a process, and waits until none of its threads runs.
#[track_caller]
pub(crate) fn stop(pid: u32) {
    signal(pid, Signal::STOP);
    look_until("a process is stopped", || std::fs::read_to_string(format!("/proc/{pid}/stat")).unwrap().contains(") T "));
}

pub(crate) fn resume(pid: u32) {
    signal(pid, Signal::CONT);
}

/// Waits for something in `/proc`, where nothing tells of a change.
#[track_caller]
pub(crate) fn look_until(what: &str, mut wanted: impl FnMut() -> bool) {
    let since = Instant::now();
    while !wanted() {
        assert!(since.elapsed() < WATCHDOG, "never: {what}");
        poll(&mut [], Some(&LOOK)).unwrap();
    }
}

/// The exit of a process, even of one that is no child of the test.
pub(crate) struct Exit(OwnedFd);

impl Exit {
    /// The exit of a process that exists.
    pub(crate) fn of(pid: u32) -> Self {
        Self(pidfd_open(pid_of(pid), PidfdFlags::empty()).unwrap())
    }

    /// The exits of all children that a process has now.
    pub(crate) fn of_children(pid: u32) -> Vec<Self> {
        children(pid).into_iter().filter_map(|child| Some(Self(pidfd_open(pid_of(child), PidfdFlags::empty()).ok()?))).collect()
    }

    /// Waits for it; whether it came before the watchdog.
    pub(crate) fn comes(&self) -> bool {
        let watchdog = Timespec { tv_sec: WATCHDOG.as_secs() as i64, tv_nsec: 0 };
        matches!(poll(&mut [PollFd::new(&self.0, PollFlags::IN)], Some(&watchdog)), Ok(1))
    }

    #[track_caller]
    pub(crate) fn wait(&self) {
        assert!(self.comes(), "a process never exits");
    }
}

/// The children of a process; none when it is gone.
pub(crate) fn children(pid: u32) -> Vec<u32> {
    let listed = std::fs::read_to_string(format!("/proc/{pid}/task/{pid}/children")).unwrap_or_default();
    listed.split_ascii_whitespace().map(|child| child.parse().unwrap()).collect()
}

/// The children of a supervisor that run a built-in process, by what they run.
pub(crate) fn built_in_children(supervisor: u32) -> BTreeMap<String, u32> {
    let program = |pid: u32| {
        let command = std::fs::read(format!("/proc/{pid}/cmdline")).ok()?;
        let words: Vec<&[u8]> = command.split(|byte| *byte == 0).collect();
        (words.get(1) == Some(&b"process".as_slice())).then(|| super::text(words[2]))
    };
    children(supervisor).into_iter().filter_map(|pid| Some((program(pid)?, pid))).collect()
}
