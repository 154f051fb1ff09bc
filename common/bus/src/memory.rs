//! How much shared memory is left.

use rustix::fs::statvfs;

use crate::error::DomainError;

/// Where shared memory is, on Linux.
const SHARED_MEMORY: &str = "/dev/shm";
/// What must be free before a deployment starts.
pub(crate) const FOR_A_DEPLOYMENT: u64 = 64 << 20;
/// What a visitor or a few new connections take at most.
pub(crate) const FOR_A_VISITOR: u64 = 2 << 20;

/// Whether so little shared memory is left that whoever joins, or writes to a page that was never in use, may be killed (bus
/// error): that is how a full `/dev/shm` shows, it is no error that could be handled.
#[must_use]
pub fn shared_memory_is_short() -> bool {
    free().is_ok_and(|free| free < FOR_A_VISITOR)
}

pub(crate) fn check_free(needed: u64) -> Result<(), DomainError> {
    let free = free()?;
    if free < needed { Err(DomainError::SharedMemory { free, needed }) } else { Ok(()) }
}

fn free() -> Result<u64, DomainError> {
    let found = statvfs(SHARED_MEMORY).map_err(|error| DomainError::Io { path: SHARED_MEMORY.into(), source: error.into() })?;
    Ok(found.f_bavail.saturating_mul(found.f_frsize))
}
