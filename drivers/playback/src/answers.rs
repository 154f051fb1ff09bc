//! How far the consumers of the replayed stream have answered it.

/// A process that consumes the replayed stream.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Consumer {
    /// Its name in the deployment.
    pub name: String,
    /// It ends by itself once the stream has ended; until then it may be killed and need the end of the stream again.
    pub ends_itself: bool,
}

/// What the consumers have said so far.
#[derive(Debug, Clone)]
pub struct Answers {
    consumers: Vec<State>,
}

#[derive(Debug, Clone)]
struct State {
    consumer: Consumer,
    /// The last message it has answered; none before it has said anything.
    answered: Option<u64>,
}

impl Answers {
    /// Nothing said yet.
    #[must_use]
    pub fn new(consumers: impl IntoIterator<Item = Consumer>) -> Self {
        Self { consumers: consumers.into_iter().map(|consumer| State { consumer, answered: None }).collect() }
    }

    /// A process has answered every message up to `seq`. One that was restarted may say less than before: what it then lacks
    /// is in the history of the stream.
    pub fn answered(&mut self, process: &str, seq: u64) {
        for state in self.consumers.iter_mut().filter(|state| state.consumer.name == process) {
            state.answered = state.answered.max(Some(seq));
        }
    }

    /// A process is over, finished or failed for good: nothing waits for it.
    pub fn over(&mut self, process: &str) {
        self.consumers.retain(|state| state.consumer.name != process);
    }

    /// The last message that every consumer has answered, where those that have said nothing are taken to have answered
    /// `assumed`; `None` when there is no consumer left.
    #[must_use]
    pub fn floor(&self, assumed: u64) -> Option<u64> {
        self.consumers.iter().map(|state| state.answered.unwrap_or(assumed)).min()
    }

    /// Who is farthest behind, and the last message it has answered.
    #[must_use]
    pub fn slowest(&self) -> Option<(&str, u64)> {
        let answered = |state: &State| state.answered.unwrap_or_default();
        self.consumers.iter().map(|state| (state.consumer.name.as_str(), answered(state))).min_by_key(|(_, seq)| *seq)
    }

    /// Whether a consumer has not said how far it is.
    #[must_use]
    pub fn lack_one(&self) -> bool {
        self.consumers.iter().any(|state| state.answered.is_none())
    }

    /// Whether nobody will need the stream again, whose last message is `last`.
    #[must_use]
    pub fn are_complete(&self, last: u64) -> bool {
        self.consumers.iter().all(|state| !state.consumer.ends_itself && state.answered >= Some(last))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn answers() -> Answers {
        let consumer = |name: &str, ends_itself| Consumer { name: name.to_owned(), ends_itself };
        Answers::new([consumer("recorder", false), consumer("mapping", true)])
    }

    #[test]
    fn the_slowest_counts() {
        let mut answers = answers();
        assert_eq!((answers.floor(0), answers.floor(5), answers.lack_one()), (Some(0), Some(5), true));
        answers.answered("recorder", 0);
        assert_eq!((answers.floor(5), answers.lack_one()), (Some(0), true));
        answers.answered("mapping", 9);
        assert_eq!((answers.floor(5), answers.lack_one(), answers.slowest()), (Some(0), false, Some(("recorder", 0))));
        answers.answered("recorder", 7);
        answers.answered("somebody", 1);
        assert_eq!(answers.floor(0), Some(7));
        answers.answered("mapping", 3);
        assert_eq!(answers.floor(0), Some(7), "a restart takes nothing back");
    }

    #[test]
    fn who_is_over_is_not_waited_for() {
        let mut answers = answers();
        answers.answered("mapping", 9);
        answers.over("recorder");
        assert_eq!(answers.floor(0), Some(9));
        answers.over("mapping");
        assert_eq!(answers.floor(0), None);
    }

    #[test]
    fn the_end_stays_available_until_those_that_end_by_it_have() {
        let mut answers = answers();
        answers.answered("mapping", 9);
        answers.answered("recorder", 8);
        answers.over("mapping");
        assert!(!answers.are_complete(9));
        answers.answered("recorder", 9);
        assert!(answers.are_complete(9));

        let mut answers = self::answers();
        answers.answered("mapping", 9);
        answers.answered("recorder", 9);
        assert!(!answers.are_complete(9), "killed now, mapping would need the last messages again");
    }
}
