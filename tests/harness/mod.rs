//! What the tests of whole deployments share: a sandbox with a runtime folder of its own, deployment files, running commands and their
//! status, and maps.

pub(crate) mod blocked_file;
mod deployment;
pub(crate) mod inotify;
mod map;
pub(crate) mod observer;
pub(crate) mod processes;
pub(crate) mod recorded_drive;
pub(crate) mod replay;
mod run;
mod sandbox;
pub(crate) mod worlds;

use std::path::Path;
use std::time::Duration;

use messages::{ProcessState, ProcessStatus};

pub(crate) use deployment::Deployment;
pub(crate) use map::{FREE, OCCUPIED, PgmMap};
pub(crate) use observer::Observer;
pub(crate) use run::{Ended, Run};
pub(crate) use sandbox::Sandbox;

/// Longest wait for one thing before a test is called hung; nothing is measured by it.
pub(crate) const WATCHDOG: Duration = Duration::from_secs(240);

/// Messages of one service in a log, in order, with their numbers.
pub(crate) fn recorded<T: drivelog::Logged>(log: &Path) -> Vec<(u64, T)> {
    let mut log = drivelog::Log::open(log).unwrap();
    let mut messages = Vec::new();
    while let Some(entry) = log.next_of::<T>().unwrap() {
        if let drivelog::Entry::Message { seq, payload, .. } = entry {
            messages.push((seq, payload));
        }
    }
    messages
}

pub(crate) fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

pub(crate) fn is_running(process: &ProcessStatus) -> bool {
    process.state == ProcessState::Running as u32
}

/// A counter of a process, if it has reported that one.
pub(crate) fn counter(process: &ProcessStatus, name: &str) -> Option<u64> {
    let counters = process.counters.iter().take(process.counters_count as usize);
    counters.filter(|counter| counter.name.as_str() == name).map(|counter| counter.value).next()
}
