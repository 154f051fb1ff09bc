//! Times of messages.

/// A time of so many nanoseconds in s.
///
/// ```
/// assert_eq!(stillmap_messages::seconds(2_500_000_000), 2.5);
/// ```
#[must_use]
pub fn seconds(ns: u64) -> f64 {
    ns as f64 * 1e-9
}
