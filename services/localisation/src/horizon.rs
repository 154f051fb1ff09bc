//! Scans that are younger than the commit horizon.

use postcard_schema::Schema;
use serde::{Deserialize, Serialize};
use state::Queue;

/// The scans whose poses were not yet answered for the map, each with what is known of it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, Schema)]
pub(crate) struct Horizon<T>(Queue<Waiting<T>>);

#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, Schema)]
struct Waiting<T> {
    seq: u64,
    stamp_ns: u64,
    content: T,
}

impl<T> Default for Horizon<T> {
    fn default() -> Self {
        Self(Queue::default())
    }
}

impl<T> Horizon<T> {
    pub(crate) fn push(&mut self, seq: u64, stamp_ns: u64, content: T) {
        self.0.push_back(Waiting { seq, stamp_ns, content });
    }

    /// The oldest scan, if it is at least as old as the horizon; with its number.
    pub(crate) fn pop_older(&mut self, now_ns: u64, horizon_ns: u64) -> Option<(u64, T)> {
        let is_old = self.0.front().is_some_and(|oldest| now_ns.saturating_sub(oldest.stamp_ns) >= horizon_ns);
        if is_old { self.pop() } else { None }
    }

    /// The oldest scan, with its number.
    pub(crate) fn pop(&mut self) -> Option<(u64, T)> {
        self.0.pop_front().map(|oldest| (oldest.seq, oldest.content))
    }
}
