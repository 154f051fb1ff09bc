//! File descriptors: how many a process needs on the bus, and which of them its children get.

use std::os::fd::{BorrowedFd, OwnedFd};

use messages::SERVICES;
use rustix::io::{Errno, FdFlags, fcntl_dupfd_cloexec, fcntl_getfd, fcntl_setfd};

/// Descriptors of a process that are not those of its services: standard streams, its node on the bus, logs, devices, connections of
/// the live page.
const OWN: usize = 64;
/// Descriptors of a service that a process reads or publishes: its messages and its event with a file, a lock and a memory each, a
/// socket, and the connection and the memory of a peer. A recorder with 18 inputs beside eight processes had 237 open in all.
const PER_SERVICE: usize = 9;
/// Descriptors of a reader of reports for each process that sends them, on two services; and those of the supervisor for a child.
const PER_PROCESS: usize = 6;

/// Most descriptors that one process of a deployment of so many processes needs.
///
/// ```
/// assert!(stillmap_bus::needed_descriptors(8) > 256, "the usual lower limit is too low");
/// ```
#[must_use]
pub fn needed_descriptors(processes: usize) -> u64 {
    (OWN + PER_SERVICE * SERVICES.len() + PER_PROCESS * processes) as u64
}

/// Most descriptors that a port or a connection takes, and gives back where it cannot take all of them.
const AT_ONCE: usize = 8;

/// Whether this process, or the system, has too few descriptors left for another port.
pub(crate) fn has_no_descriptor() -> bool {
    let taken: Result<Vec<OwnedFd>, Errno> = (0..AT_ONCE).map(|_| fcntl_dupfd_cloexec(rustix::stdio::stderr(), 0)).collect();
    matches!(taken, Err(Errno::MFILE | Errno::NFILE))
}

/// Closes every descriptor but the standard streams in programs that are started from now on.
pub(crate) fn close_on_exec() {
    let entries = std::fs::read_dir("/proc/self/fd").into_iter().flatten().flatten();
    let descriptors: Vec<i32> = entries.filter_map(|entry| entry.file_name().to_str()?.parse().ok()).collect();
    for descriptor in descriptors.into_iter().filter(|descriptor| *descriptor > 2) {
        // SAFETY: the descriptor was open a moment ago. Where it is closed or another file since, the worst is a flag that files of
        // this process have anyway.
        #[expect(unsafe_code, reason = "iceoryx2 owns the descriptors and hands out no others than those of listeners")]
        let descriptor = unsafe { BorrowedFd::borrow_raw(descriptor) };
        if let Ok(flags) = fcntl_getfd(descriptor)
            && !flags.contains(FdFlags::CLOEXEC)
        {
            let _ = fcntl_setfd(descriptor, flags | FdFlags::CLOEXEC);
        }
    }
}
