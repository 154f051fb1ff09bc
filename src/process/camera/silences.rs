//! What the log says of the times without a picture.

use std::time::Instant;

use bus::Episode;

/// A camera that stops and starts all the time is one condition in the log: the lines of the first silence, and one when the pictures
/// come steadily.
#[derive(Debug, Default)]
pub(super) struct Silences {
    episode: Episode,
    count: u64,
    /// There are no pictures now.
    is_silent: bool,
}

impl Silences {
    /// There is no picture, for a reason that is known or not; true if the log is to say so.
    pub(super) fn begin(&mut self, now: Instant) -> bool {
        if !self.is_silent {
            self.is_silent = true;
            self.count += 1;
            self.episode.occurred(now);
        }
        self.count == 1
    }

    /// There are pictures again; true if the log is to say so.
    pub(super) fn end(&mut self, now: Instant) -> bool {
        self.is_silent = false;
        self.episode.occurred(now);
        self.count == 1
    }

    /// The number of silences, when the last was so long ago that the pictures come steadily; `None` after a single one.
    pub(super) fn over(&mut self, now: Instant) -> Option<u64> {
        if self.is_silent || !self.episode.is_open() {
            return None;
        }
        let _ = self.episode.over(now);
        if self.episode.is_open() {
            return None;
        }
        Some(std::mem::take(&mut self.count)).filter(|count| *count > 1)
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;

    #[test]
    fn a_camera_that_stops_all_the_time_is_told_once() {
        let (mut silences, start) = (Silences::default(), Instant::now());
        let after = |s: u64| start + Duration::from_secs(s);
        let mut told = Vec::new();
        for s in (0..300).step_by(6) {
            told.extend(silences.begin(after(s)).then_some((s, "begins")));
            told.extend(silences.begin(after(s + 1)).then_some((s + 1, "has another reason")));
            assert_eq!(silences.over(after(s + 2)), None);
            told.extend(silences.end(after(s + 3)).then_some((s + 3, "ends")));
        }
        assert_eq!(told, [(0, "begins"), (1, "has another reason"), (3, "ends")]);
        assert_eq!((silences.over(after(300)), silences.over(after(308))), (None, Some(50)));
        assert!(silences.begin(after(400)), "a new episode");
    }

    #[test]
    fn a_single_silence_has_its_two_lines_however_long_it_is() {
        let (mut silences, start) = (Silences::default(), Instant::now());
        let after = |s: u64| start + Duration::from_secs(s);
        assert!(silences.begin(after(0)));
        assert_eq!(silences.over(after(60)), None);
        assert!(silences.end(after(61)));
        assert_eq!(silences.over(after(80)), None);
        assert!(silences.begin(after(81)) && silences.end(after(82)));
    }
}
