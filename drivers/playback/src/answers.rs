//! How far the consumers of a replayed stream have answered it.

/// A process that consumes the replayed stream.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Consumer {
    /// Its name in the deployment.
    pub name: String,
    /// It ends by itself once the stream has ended; until then it may be killed and need the end of the stream again.
    pub ends_itself: bool,
    /// How many other consumers stand before it: it waits for their answers.
    pub depth: u8,
    /// The service on which it reports its progress.
    pub reports_on: &'static str,
}

/// A consumer that playback waits for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct Behind<'a> {
    /// How many other consumers stand before it.
    pub depth: u8,
    /// The last message that it has answered.
    pub answered: u64,
    /// Its name in the deployment.
    pub name: &'a str,
}

/// The answers of the consumers so far.
#[derive(Debug, Clone)]
pub struct Answers {
    consumers: Vec<State>,
}

#[derive(Debug, Clone)]
struct State {
    consumer: Consumer,
    /// The last message that it has answered; `None` before its first report.
    answered: Option<u64>,
}

impl Answers {
    /// No answer yet.
    #[must_use]
    pub fn new(consumers: impl IntoIterator<Item = Consumer>) -> Self {
        Self { consumers: consumers.into_iter().map(|consumer| State { consumer, answered: None }).collect() }
    }

    /// A process has answered every message of a service up to `seq`. A restarted process may report less than before: what it lacks is in the
    /// history of the stream.
    pub fn answered(&mut self, process: &str, service: &str, seq: u64) {
        let reports = |consumer: &Consumer| consumer.name == process && consumer.reports_on == service;
        for state in self.consumers.iter_mut().filter(|state| reports(&state.consumer)) {
            state.answered = state.answered.max(Some(seq));
        }
    }

    /// A process is over, finished or failed for good: nothing waits for it.
    pub fn over(&mut self, process: &str) {
        self.consumers.retain(|state| state.consumer.name != process);
    }

    /// The last message that every consumer has answered, where those without a report count as having answered `assumed`; `None`
    /// without a consumer.
    #[must_use]
    pub fn floor(&self, assumed: u64) -> Option<u64> {
        self.consumers.iter().map(|state| state.answered.unwrap_or(assumed)).min()
    }

    /// The consumer that keeps the others waiting: of those that have not answered the message `last`, the one with the fewest before
    /// it, and of these the slowest.
    #[must_use]
    pub fn behind(&self, last: u64) -> Option<Behind<'_>> {
        let behind = self.consumers.iter().filter(|state| state.answered < Some(last));
        behind
            .map(|State { consumer, answered }| Behind {
                depth: consumer.depth,
                answered: answered.unwrap_or_default(),
                name: &consumer.name,
            })
            .min()
    }

    /// Whether a consumer has not reported its progress.
    #[must_use]
    pub fn lack_one(&self) -> bool {
        self.consumers.iter().any(|state| state.answered.is_none())
    }

    /// Whether no consumer can need the stream again, whose last message is `last`.
    #[must_use]
    pub fn are_complete(&self, last: u64) -> bool {
        self.consumers.iter().all(|state| !state.consumer.ends_itself && state.answered >= Some(last))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SCANS: &str = "robot/scan";

    fn consumer(name: &str, ends_itself: bool, depth: u8) -> Consumer {
        Consumer { name: name.to_owned(), ends_itself, depth, reports_on: SCANS }
    }

    fn answers() -> Answers {
        Answers::new([consumer("recorder", false, 0), consumer("mapping", true, 1)])
    }

    #[test]
    fn the_slowest_consumer_decides() {
        let mut answers = answers();
        assert_eq!((answers.floor(0), answers.floor(5), answers.lack_one()), (Some(0), Some(5), true));
        answers.answered("recorder", SCANS, 0);
        assert_eq!((answers.floor(5), answers.lack_one()), (Some(0), true));
        answers.answered("mapping", SCANS, 9);
        assert_eq!((answers.floor(5), answers.lack_one()), (Some(0), false));
        answers.answered("recorder", SCANS, 7);
        answers.answered("unknown", SCANS, 1);
        assert_eq!(answers.floor(0), Some(7));
        answers.answered("mapping", SCANS, 3);
        assert_eq!(answers.floor(0), Some(7), "a restart takes nothing back");
    }

    #[test]
    fn the_first_consumer_in_line_that_is_behind_is_named() {
        let mut answers = Answers::new([consumer("mapping", true, 2), consumer("fti", true, 1), consumer("std", true, 0)]);
        let named = |answers: &Answers| answers.behind(9).map(|behind| (behind.name.to_owned(), behind.answered));
        assert_eq!(named(&answers), Some(("std".to_owned(), 0)));
        answers.answered("mapping", SCANS, 2);
        answers.answered("fti", SCANS, 4);
        answers.answered("std", SCANS, 5);
        assert_eq!(named(&answers), Some(("std".to_owned(), 5)), "mapping and fti wait for it");
        answers.answered("std", SCANS, 9);
        assert_eq!(named(&answers), Some(("fti".to_owned(), 4)), "mapping waits for it");
        answers.answered("fti", SCANS, 9);
        answers.answered("mapping", SCANS, 9);
        assert_eq!(answers.behind(9), None);
    }

    #[test]
    fn a_report_on_another_service_is_none() {
        let mut answers = answers();
        answers.answered("mapping", "motion/camera", 9);
        answers.answered("recorder", SCANS, 9);
        assert_eq!((answers.floor(5), answers.lack_one()), (Some(5), true));
    }

    #[test]
    fn a_consumer_that_is_over_is_not_waited_for() {
        let mut answers = answers();
        answers.answered("mapping", SCANS, 9);
        answers.over("recorder");
        assert_eq!(answers.floor(0), Some(9));
        answers.over("mapping");
        assert_eq!(answers.floor(0), None);
    }

    #[test]
    fn the_end_stays_available_until_consumers_have_ended() {
        let mut answers = answers();
        answers.answered("mapping", SCANS, 9);
        answers.answered("recorder", SCANS, 8);
        answers.over("mapping");
        assert!(!answers.are_complete(9));
        answers.answered("recorder", SCANS, 9);
        assert!(answers.are_complete(9));

        let mut answers = self::answers();
        answers.answered("mapping", SCANS, 9);
        answers.answered("recorder", SCANS, 9);
        assert!(!answers.are_complete(9), "killed now, mapping would need the last messages again");
    }
}
