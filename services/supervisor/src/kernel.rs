//! What the supervisor needs of the kernel, looked for before anything starts.

use crate::running::RunError;
use rustix::io::Errno;
use rustix::process::{PidfdFlags, WaitId, WaitIdOptions, getpid, pidfd_open, waitid};
use std::os::fd::AsFd;

/// Refuses a kernel or a sandbox without descriptors of processes: `pidfd_open` came with Linux 5.3, waiting by one with Linux 5.4.
///
/// # Errors
/// The call that is missing.
pub fn check_kernel() -> Result<(), RunError> {
    let missing = |call, error: Errno| RunError::Kernel { call, source: error.into() };
    let own = pidfd_open(getpid(), PidfdFlags::empty()).map_err(|error| missing("pidfd_open", error))?;
    match waitid(WaitId::PidFd(own.as_fd()), WaitIdOptions::EXITED | WaitIdOptions::NOHANG) {
        // No process is its own child.
        Ok(_) | Err(Errno::CHILD) => Ok(()),
        Err(error) => Err(missing("waitid of a process descriptor", error)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_kernel_of_the_tests_is_new_enough() {
        check_kernel().unwrap();
    }
}
