//! Waiting for file descriptors: no busy polling, no sleeping.

use std::io;
use std::os::fd::BorrowedFd;
use std::time::Duration;

use rustix::event::{PollFd, PollFlags, Timespec, poll};

/// Waits until one of the descriptors is readable, a signal comes, or `patience` is over.
pub(crate) fn wait_readable<'a>(descriptors: impl IntoIterator<Item = BorrowedFd<'a>>, patience: Duration) -> io::Result<()> {
    let mut polled: Vec<PollFd<'_>> = descriptors.into_iter().map(|it| PollFd::from_borrowed_fd(it, PollFlags::IN)).collect();
    let timeout = Timespec { tv_sec: patience.as_secs().try_into().unwrap_or(i64::MAX), tv_nsec: patience.subsec_nanos().into() };
    match poll(&mut polled, Some(&timeout)) {
        Ok(_) | Err(rustix::io::Errno::INTR) => Ok(()),
        Err(error) => Err(error.into()),
    }
}
