//! The clock that cameras stamp pictures with.

use rustix::time::{ClockId, clock_gettime};

/// The monotonic clock, by which a camera states when it took a picture, ns.
#[must_use]
pub fn monotonic_ns() -> u64 {
    let now = clock_gettime(ClockId::Monotonic);
    now.tv_sec.unsigned_abs() * 1_000_000_000 + now.tv_nsec.unsigned_abs()
}
