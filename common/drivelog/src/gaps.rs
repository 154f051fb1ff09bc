//! What a log lacks.

use std::collections::BTreeMap;
use std::fmt;

use messages::printable;

/// Most gaps of a stream that are listed.
const MOST_LISTED: usize = 5;

/// Parts and messages that a log lacks, as far as it has been read.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Gaps {
    /// First and last number of parts that are not there.
    pub parts: Vec<(u32, u32)>,
    /// What is missing of a sensor's stream, by its service.
    pub messages: BTreeMap<String, Missing>,
    /// Parts up to this number may have been removed by the limits of the recorder. They are not in `parts`.
    pub removed: u32,
}

/// What a log lacks of one stream.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Missing {
    /// Number of messages.
    pub messages: u64,
    /// Number of gaps.
    pub gaps: u64,
    /// First and last missing message of the first gaps.
    pub ranges: Vec<(u64, u64)>,
}

impl Gaps {
    /// Whether nothing is missing.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.parts.is_empty() && self.messages.is_empty()
    }

    /// Number of parts that are not there.
    #[must_use]
    pub fn missing_parts(&self) -> u64 {
        self.parts.iter().map(|(first, last)| u64::from(last.saturating_sub(*first)) + 1).sum()
    }

    /// A line about each gap.
    #[must_use]
    pub fn lines(&self) -> Vec<String> {
        let parts = self.parts.iter().map(|(first, last)| match first == last {
            true => format!("part {first} of the log"),
            false => format!("parts {first} to {last} of the log"),
        });
        let messages = self.messages.iter().map(|(service, missing)| format!("{}: {missing}", printable(service)));
        parts.chain(messages).collect()
    }
}

impl Missing {
    /// Adds the messages from `first` to `last`.
    pub(crate) fn add(&mut self, first: u64, last: u64) {
        self.messages += last - first + 1;
        self.gaps += 1;
        if self.ranges.len() < MOST_LISTED {
            self.ranges.push((first, last));
        }
    }
}

impl fmt::Display for Missing {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let plural = |count: u64, word: &str| if count == 1 { word.to_owned() } else { format!("{word}s") };
        write!(f, "{} {}: ", self.messages, plural(self.messages, "message"))?;
        for (index, (first, last)) in self.ranges.iter().enumerate() {
            let separator = if index > 0 { ", " } else { "" };
            let range = if first == last { first.to_string() } else { format!("{first} to {last}") };
            write!(f, "{separator}{range}")?;
        }
        let unlisted = self.gaps - self.ranges.len() as u64;
        if unlisted > 0 { write!(f, " and {unlisted} more {}", plural(unlisted, "gap")) } else { Ok(()) }
    }
}
