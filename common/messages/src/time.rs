//! Times of messages.

/// A time of so many nanoseconds in s.
#[must_use]
pub fn seconds(ns: u64) -> f64 {
    ns as f64 * 1e-9
}
