//! What of a bag is left out, counted by its reason.

use std::collections::BTreeMap;

/// Counts by what is counted and the reason.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub(crate) struct Tally(BTreeMap<String, u64>);

impl Tally {
    /// Counts one message of a topic.
    pub(crate) fn add(&mut self, topic: &str, reason: &str) {
        *self.0.entry(format!("topic {topic}: {reason}")).or_default() += 1;
    }

    /// One line for each reason.
    pub(crate) fn lines(&self) -> Vec<String> {
        self.0.iter().map(|(reason, count)| format!("{reason} ({count} {})", if *count == 1 { "message" } else { "messages" })).collect()
    }
}
