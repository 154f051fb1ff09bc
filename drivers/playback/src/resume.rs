//! What a restarted playback goes on from.

use messages::{Payload, SonarScan};

use crate::schedule::Schedule;

/// Messages between two notes of how far playback has come.
const RESERVE: u64 = 64;
/// Messages that a restarted playback sends beyond its note while a consumer has not said how far it is: the first of them is
/// new to every consumer, so that each answers.
pub(crate) const SPARE: u32 = 64;

/// How far playback may have come, kept for its next incarnation.
///
/// A dead sender takes the history of its stream with it, and a consumer that dies next goes on from a checkpoint that lies
/// further back than what it has answered. So a restarted playback sends again what the history held, less `SPARE`; what a
/// consumer has had, its reader drops. That history covers the window of lockstep, a consumer's checkpoint interval and this
/// note's.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Resume {
    /// Nothing after this message has been sent.
    pub reserved: u64,
    /// When messages are due, for a live replay.
    pub schedule: Option<Schedule>,
}

impl Resume {
    /// The message behind which a restarted playback begins.
    #[must_use]
    pub fn begin_behind(&self) -> u64 {
        self.reserved.saturating_sub(SonarScan::SERVICE.qos.history as u64 - u64::from(SPARE))
    }

    /// Makes room for a message that is about to be sent; true when the note has changed and has to be kept first.
    pub fn reserve(&mut self, seq: u64) -> bool {
        let fits = seq <= self.reserved;
        if !fits {
            self.reserved = seq.saturating_add(RESERVE - 1);
        }
        !fits
    }

    /// For the next incarnation.
    #[must_use]
    pub fn to_bytes(self) -> Vec<u8> {
        let mut bytes = self.reserved.to_le_bytes().to_vec();
        bytes.extend(self.schedule.map(Schedule::to_bytes).unwrap_or_default());
        bytes
    }

    /// From an earlier one.
    #[must_use]
    pub fn from_bytes(bytes: &[u8]) -> Option<Self> {
        let (reserved, rest) = bytes.split_first_chunk()?;
        let schedule = if rest.is_empty() { None } else { Some(Schedule::from_bytes(rest)?) };
        Some(Self { reserved: u64::from_le_bytes(*reserved), schedule })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn a_note_is_taken_before_it_is_passed() {
        let mut resume = Resume::default();
        let notes: Vec<u64> = (1..=200).filter(|seq| resume.reserve(*seq)).collect();
        assert_eq!(notes, [1, 65, 129, 193]);
        assert!(resume.reserve(10_000), "numbers may be missing in a log");
        assert!(resume.reserved >= 10_000);
    }

    #[test]
    fn a_note_reads_as_it_was_written() {
        for resume in [Resume::default(), Resume { reserved: 77, schedule: Some(Schedule::new(5, 6)) }] {
            assert_eq!(Resume::from_bytes(&resume.to_bytes()), Some(resume));
        }
        assert_eq!(Resume::from_bytes(&[0; 7]), None);
        assert_eq!(Resume::from_bytes(&[0; 9]), None);
    }

    proptest! {
        /// Playback and a consumer die together: whatever the consumer's checkpoint, what it lacks is sent again, something is
        /// new to it, and all of it fits the history that it finds when it comes later.
        #[test]
        fn what_a_restarted_consumer_lacks_comes_again(sent in 1u64..100_000, window in 1u64..=256, interval in 1u64..=128, behind: u64) {
            let mut resume = Resume::default();
            (1..=sent).for_each(|seq| { resume.reserve(seq); });
            let checkpoint = sent - behind % (window + interval).min(sent + 1);
            let (first, last) = (resume.begin_behind() + 1, resume.reserved + u64::from(SPARE));
            prop_assert!(first <= checkpoint + 1);
            prop_assert!(last > checkpoint);
            prop_assert!(last - first < SonarScan::SERVICE.qos.history as u64);
        }
    }
}
