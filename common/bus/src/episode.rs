//! One line in the log for a condition that many messages report.

use std::time::{Duration, Instant};

/// An episode is over when its condition has not occurred for this long. Log lines of a condition that comes and goes are then at
/// most six a minute, and a person who looks at the log sees the end while it still matters.
const QUIET: Duration = Duration::from_secs(10);

/// A condition that may occur with every message: it is logged once when it begins and once when it is over, with the number of
/// occurrences.
///
/// ```
/// use std::time::{Duration, Instant};
/// use stillmap_bus::Episode;
///
/// let (mut refused, start) = (Episode::default(), Instant::now());
/// assert!(refused.occurred(start), "the first is logged");
/// assert!(!refused.occurred(start), "the second is counted");
/// assert_eq!(refused.over(start + Duration::from_secs(11)), Some(2));
/// ```
#[derive(Debug, Clone, Copy, Default)]
pub struct Episode(Option<Occurrences>);

#[derive(Debug, Clone, Copy)]
struct Occurrences {
    count: u64,
    last: Instant,
}

impl Episode {
    /// Counts an occurrence; true if it begins an episode.
    pub fn occurred(&mut self, now: Instant) -> bool {
        let before = self.0.map_or(0, |occurrences| occurrences.count);
        self.0 = Some(Occurrences { count: before + 1, last: now });
        before == 0
    }

    /// Whether an episode has begun and its end is not reported.
    #[must_use]
    pub fn is_open(&self) -> bool {
        self.0.is_some()
    }

    /// Ends the episode if the condition has not occurred for ten seconds. The number of occurrences, if there were several: the line
    /// at the beginning has told of a single one.
    pub fn over(&mut self, now: Instant) -> Option<u64> {
        let last = self.0?.last;
        if now.saturating_duration_since(last) >= QUIET { self.close() } else { None }
    }

    /// Ends the episode now, as at the end of a stream; the same number.
    pub fn close(&mut self) -> Option<u64> {
        self.0.take().map(|occurrences| occurrences.count).filter(|count| *count > 1)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_condition_that_comes_and_goes_is_one_episode() {
        let (mut episode, start) = (Episode::default(), Instant::now());
        let after = |s: u64| start + Duration::from_secs(s);
        let begun: Vec<bool> = (0..30).map(|s| episode.occurred(after(s)) | episode.over(after(s)).is_some()).collect();
        assert_eq!(begun.iter().filter(|begun| **begun).count(), 1);
        assert_eq!((episode.over(after(38)), episode.over(after(39)), episode.over(after(50))), (None, Some(30), None));
        assert!(episode.occurred(after(60)), "a new episode");
        assert_eq!(episode.over(after(70)), None, "a single occurrence has no line at its end");
        assert!(!episode.is_open());
    }
}
