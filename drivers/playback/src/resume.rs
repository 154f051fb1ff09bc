//! What a restarted playback goes on from.

use messages::{CameraFrame, CameraMotion, Payload, Pictures, SonarScan};

use crate::schedule::Schedule;

/// The streams that are played, in the order of [`Resume::reserved`].
pub const STREAMS: [Stream; 3] = [
    Stream { history: SonarScan::SERVICE.qos.history as u64, reserve: 64, spare: 64 },
    Stream { history: CameraFrame::SERVICE.qos.history as u64, reserve: 4, spare: 4 },
    Stream { history: CameraMotion::SERVICE.qos.history as u64, reserve: 64, spare: 64 },
];

/// How a stream is taken up again.
///
/// A dead sender takes the history of its stream with it, and a consumer that dies next goes on from a checkpoint that lies
/// further back than what it has answered. So a restarted playback sends again what the history held, less `spare`; what a
/// consumer has had, its reader drops. That history covers the window of lockstep, a consumer's checkpoint interval and this
/// note's.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Stream {
    /// Messages that a late reader still gets.
    pub history: u64,
    /// Messages between two notes of how far playback has come.
    pub reserve: u64,
    /// Messages that a restarted playback sends beyond its note while a consumer has not said how far it is: the first of them
    /// is new to every consumer, so that each answers.
    pub spare: u32,
}

/// How far playback may have come, kept for its next incarnation.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Resume {
    /// Of each stream nothing after this message has been sent.
    pub reserved: [u64; STREAMS.len()],
    /// When messages are due, for a live replay.
    pub schedule: Option<Schedule>,
}

impl Resume {
    /// The message of each stream behind which a restarted playback begins.
    #[must_use]
    pub fn begin_behind(&self) -> [u64; STREAMS.len()] {
        let mut begin = self.reserved;
        for (seq, Stream { history, spare, .. }) in begin.iter_mut().zip(STREAMS) {
            *seq = seq.saturating_sub(history - u64::from(spare));
        }
        begin
    }

    /// Makes room for a message of a stream that is about to be sent; true when the note has changed and has to be kept first.
    pub fn reserve(&mut self, stream: usize, seq: u64) -> bool {
        let (Some(reserved), Some(Stream { reserve, .. })) = (self.reserved.get_mut(stream), STREAMS.get(stream)) else { return false };
        let fits = seq <= *reserved;
        if !fits {
            *reserved = seq.saturating_add(reserve - 1);
        }
        !fits
    }

    /// For the next incarnation.
    #[must_use]
    pub fn to_bytes(self) -> Vec<u8> {
        let mut bytes = self.reserved.map(u64::to_le_bytes).concat();
        bytes.extend(self.schedule.map(Schedule::to_bytes).unwrap_or_default());
        bytes
    }

    /// From an earlier one.
    #[must_use]
    pub fn from_bytes(bytes: &[u8]) -> Option<Self> {
        let (numbers, rest) = bytes.split_at_checked(8 * STREAMS.len())?;
        let mut reserved = [0; STREAMS.len()];
        for (seq, number) in reserved.iter_mut().zip(numbers.as_chunks::<8>().0) {
            *seq = u64::from_le_bytes(*number);
        }
        let schedule = if rest.is_empty() { None } else { Some(Schedule::from_bytes(rest)?) };
        Some(Self { reserved, schedule })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn a_note_is_taken_before_it_is_passed() {
        let mut resume = Resume::default();
        let notes: Vec<u64> = (1..=200).filter(|seq| resume.reserve(0, *seq)).collect();
        assert_eq!(notes, [1, 65, 129, 193]);
        assert!(resume.reserve(0, 10_000), "numbers may be missing in a log");
        assert!(resume.reserved[0] >= 10_000);
        let notes: Vec<u64> = (1..=12).filter(|seq| resume.reserve(1, *seq)).collect();
        assert_eq!(notes, [1, 5, 9], "pictures are fewer");
    }

    #[test]
    fn a_note_reads_as_it_was_written() {
        for resume in [Resume::default(), Resume { reserved: [77, 5, 78], schedule: Some(Schedule::new(5, 6)) }] {
            assert_eq!(Resume::from_bytes(&resume.to_bytes()), Some(resume));
        }
        assert_eq!(Resume::from_bytes(&[0; 23]), None);
        assert_eq!(Resume::from_bytes(&[0; 25]), None);
    }

    /// Playback and a consumer die together: whatever the consumer's checkpoint, what it lacks is sent again, something is new
    /// to it, and all of it fits the history that it finds when it comes later.
    fn check_restart(stream: usize, sent: u64, window: u64, interval: u64, behind: u64) -> Result<(), TestCaseError> {
        let mut resume = Resume::default();
        (1..=sent).for_each(|seq| {
            resume.reserve(stream, seq);
        });
        let checkpoint = sent - behind % (window + interval).min(sent + 1);
        let Stream { history, spare, .. } = STREAMS[stream];
        let (first, last) = (resume.begin_behind()[stream] + 1, resume.reserved[stream] + u64::from(spare));
        prop_assert!(first <= checkpoint + 1);
        prop_assert!(last > checkpoint);
        prop_assert!(last - first < history);
        Ok(())
    }

    proptest! {
        #[test]
        fn what_a_restarted_consumer_lacks_comes_again(sent in 1u64..100_000, window in 1u64..=256, interval in 1u64..=128, behind: u64) {
            check_restart(0, sent, window, interval, behind)?;
        }

        #[test]
        fn so_do_pictures(sent in 1u64..100_000, window in 1u64..=u64::from(crate::process::FRAME_WINDOW), interval in 1u64..=8, behind: u64) {
            check_restart(1, sent, window, interval, behind)?;
        }
    }
}
