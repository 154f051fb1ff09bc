//! The numbers of the messages of each stream.

use std::collections::BTreeMap;

use messages::{CameraFrame, Payload, Pictures, SonarScan};

use crate::gaps::Missing;

/// The drivers number these without gaps. Other streams carry the numbers of the messages that they answer, of which a busy process may
/// skip some.
const SOURCES: [&str; 2] = [SonarScan::SERVICE.name, CameraFrame::SERVICE.name];
/// Follows the numbers of the streams through the parts of a log.
#[derive(Default)]
pub(crate) struct Numbers {
    /// The last message of each stream.
    last: BTreeMap<String, u64>,
    missing: BTreeMap<String, Missing>,
}

impl Numbers {
    /// Begins anew: the parts before this one were removed on purpose.
    pub(crate) fn forget(&mut self) {
        self.last.clear();
    }

    /// Takes the next message of a stream, by the low 32 bits of its number; false when it was there before. A restarted recorder receives
    /// messages again that it had recorded. `is_first_part` says that nothing is missing before the part.
    pub(crate) fn take(&mut self, topic: &str, sequence: u32, is_first_part: bool) -> bool {
        let last = self.last.get_mut(topic);
        // A stream that begins in a later part has begun with the run.
        let starts_at_one = !is_first_part && topic == SonarScan::SERVICE.name;
        let (before, ahead) = match &last {
            // Two numbers that are less than 2³¹ apart.
            Some(last) => (**last, i64::from(sequence.wrapping_sub(**last as u32) as i32)),
            None if starts_at_one => (0, i64::from(sequence)),
            None => (u64::from(sequence).wrapping_sub(1), 1),
        };
        let Some(skipped) = u64::try_from(ahead).ok().and_then(|ahead| ahead.checked_sub(1)) else { return false };
        let number = before.wrapping_add(skipped + 1);
        if skipped > 0 && SOURCES.contains(&topic) {
            self.missing.entry(topic.to_owned()).or_default().add(before + 1, number - 1);
        }
        match last {
            Some(last) => *last = number,
            None => {
                self.last.insert(topic.to_owned(), number);
            }
        }
        true
    }

    pub(crate) fn missing(&self) -> &BTreeMap<String, Missing> {
        &self.missing
    }

    pub(crate) fn into_missing(self) -> BTreeMap<String, Missing> {
        self.missing
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SCANS: &str = SonarScan::SERVICE.name;

    fn missing(parts: &[&[u32]], topic: &str) -> Option<String> {
        let mut numbers = Numbers::default();
        for (part, sequences) in parts.iter().enumerate() {
            for sequence in *sequences {
                numbers.take(topic, *sequence, part == 0);
            }
        }
        numbers.missing().get(topic).map(Missing::to_string)
    }

    #[test]
    fn gaps_in_the_numbers_of_a_stream_are_listed() {
        assert_eq!(missing(&[&[1, 2], &[2, 3]], SCANS), None);
        assert_eq!(missing(&[&[1, 2], &[4]], SCANS), Some("1 message: 3".to_owned()));
        assert_eq!(missing(&[&[7, 8, 12], &[20]], SCANS), Some("10 messages: 9 to 11, 13 to 19".to_owned()));
        let listed = "6 messages: 2, 4, 6, 8, 10 and 1 more gap";
        assert_eq!(missing(&[&[1, 3, 5, 7, 9, 11, 13]], SCANS), Some(listed.to_owned()));
    }

    #[test]
    fn numbers_may_pass_32_bits() {
        assert_eq!(missing(&[&[u32::MAX - 1, u32::MAX, 0, 1]], SCANS), None);
        assert_eq!(missing(&[&[u32::MAX, 1]], SCANS), Some("1 message: 4294967296".to_owned()));
    }

    #[test]
    fn scans_that_begin_in_a_later_part_lack_the_first_ones() {
        assert_eq!(missing(&[&[], &[4]], SCANS), Some("3 messages: 1 to 3".to_owned()));
        assert_eq!(missing(&[&[], &[4]], CameraFrame::SERVICE.name), None);
    }

    #[test]
    fn a_stream_of_answers_may_skip_numbers() {
        assert_eq!(missing(&[&[1, 9]], "motion/camera"), None);
    }
}
