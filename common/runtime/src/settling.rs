//! The time after a start in which no deadline applies.

use std::time::{Duration, Instant};

/// How long a started process waits for what was sent before, whatever the deadlines say. A sender gives it to a new reader at its next
/// send or in its next round, 100 ms later at most; ten times that leaves room for a busy machine.
const SETTLING: Duration = Duration::from_secs(1);

/// Whether a process that joins several streams by deadlines of sensor time is still to have what was sent before its start: one sender
/// hands it over sooner than another, and scans of seconds that come at once would seem to be without answers.
///
/// ```
/// let mut settling = stillmap_runtime::Settling::begin();
/// assert!(!settling.is_over_now());
/// ```
#[derive(Debug)]
pub struct Settling {
    until: Option<Instant>,
}

impl Settling {
    /// Begins with the process.
    #[must_use]
    pub fn begin() -> Self {
        Self { until: Some(Instant::now() + SETTLING) }
    }

    /// Whether it is over and was not when this was last asked: deadlines apply from now on.
    pub fn is_over_now(&mut self) -> bool {
        self.until.take_if(|until| Instant::now() >= *until).is_some()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_is_over_once() {
        let mut settling = Settling { until: Some(Instant::now()) };
        assert_eq!([settling.is_over_now(), settling.is_over_now()], [true, false]);
        assert!(!Settling::begin().is_over_now());
    }
}
