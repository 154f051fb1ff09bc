//! How much shared memory is left, and how much a deployment needs.

use std::convert::Infallible;

use messages::{FrameHeader, Header, Payload, Pictures, Service, ServiceVisitor, visit_services};
use rustix::fs::statvfs;

use crate::error::DomainError;

/// Where shared memory is, on Linux.
const SHARED_MEMORY: &str = "/dev/shm";
/// What an observer or a few new connections take at most.
pub(crate) const FOR_AN_OBSERVER: u64 = 2 << 20;
/// What the files of all services take while no process has joined: 0.9 MB was measured for 20 services, in pages of 4 kB.
pub(crate) const FOR_THE_SERVICES: u64 = 2 << 20;
/// What the connections and events of a process take: those of the eight processes of the demo took 1.0 MB.
const FOR_A_PROCESS: u64 = 128 << 10;

/// Whether so little shared memory is left that a process that joins, or writes to a page that was never in use, may be killed (bus
/// error). A full `/dev/shm` shows that way only; it is no error that could be handled.
///
/// ```
/// if stillmap_bus::shared_memory_is_short() {
///     eprintln!("/dev/shm is nearly full: nothing is started now");
/// }
/// ```
#[must_use]
pub fn shared_memory_is_short() -> bool {
    free().is_ok_and(|free| free < FOR_AN_OBSERVER)
}

pub(crate) fn check_free(needed: u64) -> Result<(), DomainError> {
    let free = free()?;
    if free < needed { Err(DomainError::SharedMemory { free, needed }) } else { Ok(()) }
}

/// What a deployment takes while its processes keep up, and an observer beside it, bytes. Only services that are sent take part. The
/// demo took 4.9 MB of the 9.6 MB that this is for its eight processes and pictures of 160 × 120 pixels.
///
/// ```
/// let is_sent = |service: &messages::Service| service.from != ["localisation"];
/// let demo = stillmap_bus::needed_memory(8, 160 * 120, &is_sent);
/// assert!(demo < 10_000_000 && stillmap_bus::needed_memory(8, 640 * 480 * 3, &is_sent) > demo);
/// ```
#[must_use]
pub fn needed_memory(processes: usize, picture_bytes: usize, is_sent: &dyn Fn(&Service) -> bool) -> u64 {
    let mut needed = Needed { processes: processes as u64, picture_bytes: picture_bytes as u64, is_sent, bytes: 0 };
    let Ok(()) = visit_services(&mut needed);
    needed.bytes + FOR_THE_SERVICES + FOR_AN_OBSERVER + needed.processes * FOR_A_PROCESS
}

/// Adds up what the messages of all services take.
struct Needed<'a> {
    processes: u64,
    picture_bytes: u64,
    is_sent: &'a dyn Fn(&Service) -> bool,
    bytes: u64,
}

/// Share of a reader's buffer that is in use where the reader keeps up.
const BUFFER_IN_USE: usize = 8;

impl ServiceVisitor for Needed<'_> {
    type Error = Infallible;

    fn message<T: Payload>(&mut self) -> Result<(), Infallible> {
        if !(self.is_sent)(&T::SERVICE) {
            return Ok(());
        }
        let qos = T::SERVICE.qos;
        // Only reports come from every process: their service has a place for each.
        let senders = if qos.publishers > self.processes as usize { self.processes } else { 1 };
        let messages = qos.history + qos.buffer / BUFFER_IN_USE;
        self.bytes += senders * (messages * (size_of::<T>() + size_of::<Header>())) as u64;
        Ok(())
    }

    fn pictures<P: Pictures>(&mut self) -> Result<(), Infallible> {
        if !(self.is_sent)(&P::SERVICE) {
            return Ok(());
        }
        let qos = P::SERVICE.qos;
        let pictures = (qos.history + qos.buffer / BUFFER_IN_USE) as u64;
        self.bytes += pictures * (self.picture_bytes.min(P::MAX_BYTES as u64) + size_of::<FrameHeader>() as u64);
        Ok(())
    }
}

fn free() -> Result<u64, DomainError> {
    let found = statvfs(SHARED_MEMORY).map_err(|error| DomainError::Io { path: SHARED_MEMORY.into(), source: error.into() })?;
    Ok(found.f_bavail.saturating_mul(found.f_frsize))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_demo_needs_a_few_megabytes() {
        let is_sent = |service: &Service| service.from != ["localisation"];
        let demo = needed_memory(8, 160 * 120, &is_sent);
        assert!((5 << 20..10 << 20).contains(&demo), "{demo} bytes");
        assert!(needed_memory(8, 640 * 480 * 3, &is_sent) > demo + 24 * 640 * 480 * 3, "large pictures");
        assert!(needed_memory(8, 160 * 120, &|_| true) > demo + (1 << 20), "the streams of localisation");
    }
}
