//! What of a bag is left out, counted by its reason.

use std::collections::BTreeMap;

/// Most reasons that are told apart: each names a topic, and a bag of strangers may have any number of them.
const MOST_REASONS: usize = 50;

/// Counts by what is counted and the reason.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub(crate) struct Tally {
    reasons: BTreeMap<String, u64>,
    /// Messages for reasons beyond.
    others: u64,
}

impl Tally {
    /// Counts one message of a topic.
    pub(crate) fn add(&mut self, topic: &str, reason: &str) {
        let reason = format!("topic {topic}: {reason}");
        if self.reasons.len() >= MOST_REASONS && !self.reasons.contains_key(&reason) {
            self.others += 1;
        } else {
            *self.reasons.entry(reason).or_default() += 1;
        }
    }

    /// One line for each reason.
    pub(crate) fn lines(&self) -> Vec<String> {
        let line = |(reason, count): (&str, u64)| format!("{reason} ({count} {})", if count == 1 { "message" } else { "messages" });
        let reasons = self.reasons.iter().map(|(reason, count)| (reason.as_str(), *count));
        let others = (self.others > 0).then_some(("for other reasons", self.others));
        reasons.chain(others).map(line).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reasons_beyond_the_listed_are_counted_as_one() {
        let mut tally = Tally::default();
        for reason in (0..60).chain([0, 59]) {
            tally.add("/t", &reason.to_string());
        }
        let lines = tally.lines();
        assert_eq!(lines.len(), 51);
        assert_eq!((lines[0].as_str(), lines[50].as_str()), ("topic /t: 0 (2 messages)", "for other reasons (11 messages)"));
    }
}
