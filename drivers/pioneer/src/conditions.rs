//! The conditions of one robot while they last: one line in the log when each begins, one when it ends, and its words in the
//! status in between.

use crate::condition::Condition;
use crate::event::Event;

/// A condition that has not been seen for this long is over: a stall or a bumper that comes and goes with each packet is one.
const OVER_NS: u64 = 2_000_000_000;

#[derive(Debug, Clone, PartialEq)]
struct Active {
    since_ns: u64,
    last_ns: u64,
    words: String,
}

/// The conditions of one robot.
#[derive(Debug, Clone, Default)]
pub(crate) struct Conditions {
    active: [Option<Active>; Condition::ALL.len()],
}

impl Conditions {
    /// Takes what a packet at `now_ns` shows of a condition: its words while it holds. Returns what the log should say, if anything.
    pub(crate) fn observe(&mut self, condition: Condition, words: Option<String>, now_ns: u64) -> Option<Event> {
        let slot = &mut self.active[condition as usize];
        match (slot.as_mut(), words) {
            (None, None) => None,
            (None, Some(words)) => {
                *slot = Some(Active { since_ns: now_ns, last_ns: now_ns, words: words.clone() });
                Some(Event::ConditionBegan { condition, words })
            }
            (Some(active), Some(words)) => {
                (active.last_ns, active.words) = (now_ns, words);
                None
            }
            (Some(active), None) if now_ns.saturating_sub(active.last_ns) < OVER_NS => None,
            (Some(_), None) => {
                let Active { since_ns, last_ns, words } = slot.take()?;
                Some(Event::ConditionEnded { condition, words, lasted_s: last_ns.saturating_sub(since_ns) as f64 / 1e9 })
            }
        }
    }

    /// Whether a condition holds.
    pub(crate) fn holds(&self, condition: Condition) -> bool {
        self.active[condition as usize].is_some()
    }

    /// The link is down: nothing is known any more.
    pub(crate) fn clear(&mut self) {
        *self = Self::default();
    }

    /// All that holds, in words for the status; empty when nothing does.
    pub(crate) fn words(&self) -> String {
        self.active.iter().flatten().map(|active| active.words.as_str()).collect::<Vec<_>>().join("; ")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const S: u64 = 1_000_000_000;

    #[test]
    fn a_flickering_condition_is_one_line_at_each_end() {
        let mut conditions = Conditions::default();
        let said: Vec<_> = (0..100_u64)
            .filter_map(|packet| {
                let words = (packet < 50 && packet % 3 == 0).then(|| format!("stalled {packet}"));
                conditions.observe(Condition::Stall, words, 100 * S + packet * S / 10)
            })
            .collect();
        let [Event::ConditionBegan { words, .. }, Event::ConditionEnded { lasted_s, .. }] = &said[..] else { unreachable!("{said:?}") };
        assert_eq!((words.as_str(), *lasted_s), ("stalled 0", 4.8));
        assert_eq!(conditions.words(), "");
    }

    #[test]
    fn the_status_names_what_holds_in_the_order_of_urgency() {
        let mut conditions = Conditions::default();
        for (condition, words) in [(Condition::LowBattery, "battery low"), (Condition::EmergencyStop, "stopped")] {
            conditions.observe(condition, Some(words.to_owned()), S);
        }
        assert_eq!(conditions.words(), "stopped; battery low");
        assert!(conditions.holds(Condition::LowBattery) && !conditions.holds(Condition::Stall));
        conditions.clear();
        assert_eq!(conditions.words(), "");
    }
}
