//! The state that a restarted playback resumes from.

use std::collections::VecDeque;

use messages::{Replay, SERVICES};

use crate::schedule::Schedule;

/// The services of the registry that are played, in its order, which is that of [`Resume::reserved`].
pub const STREAMS: [Stream; count_of_streams()] = {
    let mut streams = [Stream { service: "", history: 0, replay: Replay::SCANS }; count_of_streams()];
    let (mut at, mut stream) = (0, 0);
    while at < SERVICES.len() {
        let service = &SERVICES[at];
        if let Some(replay) = service.replay {
            streams[stream] = Stream { service: service.name, history: service.qos.history, replay };
            stream += 1;
        }
        at += 1;
    }
    streams
};

const fn count_of_streams() -> usize {
    let (mut at, mut count) = (0, 0);
    while at < SERVICES.len() {
        count += SERVICES[at].replay.is_some() as usize;
        at += 1;
    }
    count
}

/// How a stream is resumed: see [`Replay`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Stream {
    /// Name of its service.
    pub service: &'static str,
    /// Messages that a late reader still receives.
    pub history: usize,
    /// What the registry declares.
    pub replay: Replay,
}

impl Stream {
    /// Messages before the saved place that a restarted playback sends again.
    fn again(&self) -> usize {
        self.replay.resent(self.history) as usize
    }
}

/// How far playback may have sent, saved for its next incarnation.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Resume {
    /// For each stream, a message after which nothing has been sent.
    pub reserved: [u64; STREAMS.len()],
    /// For each stream, the message after which a restarted playback begins.
    pub begin_behind: [u64; STREAMS.len()],
    /// When messages are due, for a live replay.
    pub schedule: Option<Schedule>,
    /// The last messages that this incarnation has sent of each stream, the oldest first.
    sent: [VecDeque<u64>; STREAMS.len()],
}

impl Resume {
    /// Reserves the number of a message that is about to be sent; true if the state has changed and must be saved before.
    pub fn reserve(&mut self, stream: usize, seq: u64) -> bool {
        let (Some(reserved), Some(begin_behind)) = (self.reserved.get_mut(stream), self.begin_behind.get_mut(stream)) else { return false };
        let (Some(sent), Some(of)) = (self.sent.get_mut(stream), STREAMS.get(stream)) else { return false };
        sent.push_back(seq);
        let before = if sent.len() > of.again() { sent.pop_front() } else { None };
        let fits = seq <= *reserved;
        if !fits {
            *reserved = seq.saturating_add(of.replay.reserve - 1);
            *begin_behind = before.unwrap_or(*begin_behind);
        }
        !fits
    }

    /// For the next incarnation.
    #[must_use]
    pub fn to_bytes(&self) -> Vec<u8> {
        let mut bytes = [self.reserved, self.begin_behind].as_flattened().iter().flat_map(|seq| seq.to_le_bytes()).collect::<Vec<u8>>();
        bytes.extend(self.schedule.map(Schedule::to_bytes).unwrap_or_default());
        bytes
    }

    /// From an earlier one.
    #[must_use]
    pub fn from_bytes(bytes: &[u8]) -> Option<Self> {
        let mut resume = Self::default();
        let (numbers, rest) = bytes.split_at_checked(2 * 8 * STREAMS.len())?;
        let places = resume.reserved.iter_mut().chain(&mut resume.begin_behind);
        for (seq, number) in places.zip(numbers.as_chunks::<8>().0) {
            *seq = u64::from_le_bytes(*number);
        }
        resume.schedule = if rest.is_empty() { None } else { Some(Schedule::from_bytes(rest)?) };
        Some(resume)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn the_streams_are_the_played_services() {
        assert_eq!(STREAMS.map(|stream| stream.service), ["robot/scan", "camera/frame", "motion/camera"]);
    }

    #[test]
    fn a_place_is_saved_before_it_is_passed() {
        let mut resume = Resume::default();
        let notes: Vec<u64> = (1..=200).filter(|seq| resume.reserve(0, *seq)).collect();
        assert_eq!(notes, [1, 65, 129, 193]);
        assert!(resume.reserve(0, 10_000), "numbers may be missing in a log");
        assert!(resume.reserved[0] >= 10_000);
        let notes: Vec<u64> = (1..=12).filter(|seq| resume.reserve(1, *seq)).collect();
        assert_eq!(notes, [1, 5, 9], "pictures are fewer");
    }

    #[test]
    fn a_saved_state_reads_as_it_was_written() {
        let noted = Resume { reserved: [77, 5, 78], begin_behind: [3, 1, 4], schedule: Some(Schedule::new(5, 6)), ..Resume::default() };
        for resume in [Resume::default(), noted] {
            assert_eq!(Resume::from_bytes(&resume.to_bytes()), Some(resume));
        }
        assert_eq!(Resume::from_bytes(&[0; 47]), None);
        assert_eq!(Resume::from_bytes(&[0; 49]), None);
    }

    /// The numbers of a log's messages: so many in a row, then so many that are missing.
    fn numbers(rows: &[(u64, u64)]) -> Vec<u64> {
        let mut next = 1;
        let row = |(count, missing): &(u64, u64)| {
            let first = next;
            next = first + count + missing;
            first..first + count
        };
        rows.iter().flat_map(row).collect()
    }

    /// Playback and a consumer are killed together, each time after so many further messages: for every checkpoint of the consumer, what
    /// it lacks is sent again, something is new to it, and all of it fits into the history.
    fn check_restarts(stream: usize, log: &[u64], lives: &[usize], window: u64, interval: u64, behind: u64) -> Result<(), TestCaseError> {
        let Stream { history, replay: Replay { lead, .. }, .. } = STREAMS[stream];
        let up_to = |seq: u64| log.partition_point(|it| *it <= seq);
        let (mut first, mut sent) = (0, 0);
        let mut resume = Resume::default();
        for more in lives {
            sent = log.len().min(sent + more);
            for seq in &log[first..sent] {
                resume.reserve(stream, *seq);
            }
            resume = Resume::from_bytes(&resume.to_bytes()).unwrap();
            first = up_to(resume.begin_behind[stream]);
            let last = up_to(resume.reserved[stream]) + lead as usize;
            let lacking = (behind % (window + interval)) as usize;
            prop_assert!(first <= sent.saturating_sub(lacking), "begins with message {first} of {sent}, and {lacking} are lacking");
            prop_assert!(last > sent, "nothing is new up to message {last} of {sent}");
            prop_assert!(last - first <= history, "{first} to {last} are more than the history holds");
        }
        Ok(())
    }

    fn rows() -> impl Strategy<Value = Vec<(u64, u64)>> {
        prop::collection::vec((1u64..800, prop_oneof![Just(0), 1u64..1_000]), 1..20)
    }

    fn lives() -> impl Strategy<Value = Vec<usize>> {
        prop::collection::vec(0usize..2_000, 1..5)
    }

    proptest! {
        #[test]
        fn a_restarted_consumer_receives_what_it_lacks(rows in rows(), lives in lives(), window in 1u64..=256, interval in 1u64..=128, behind: u64) {
            check_restarts(0, &numbers(&rows), &lives, window, interval, behind)?;
        }

        #[test]
        fn a_restarted_consumer_receives_the_pictures_it_lacks(rows in rows(), lives in lives(), window in 1u64..=u64::from(Replay::FRAMES.window), interval in 1u64..=8, behind: u64) {
            check_restarts(1, &numbers(&rows), &lives, window, interval, behind)?;
        }

        #[test]
        fn a_restarted_consumer_receives_the_camera_motion_it_lacks(rows in rows(), lives in lives(), window in 1u64..=256, interval in 1u64..=128, behind: u64) {
            check_restarts(2, &numbers(&rows), &lives, window, interval, behind)?;
        }
    }
}
