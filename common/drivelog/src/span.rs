//! A span of a log's time.

/// A span of a log's time, from its first message on.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Span {
    /// What is earlier is left out, ns.
    pub from_ns: u64,
    /// What is later is left out, ns.
    pub to_ns: Option<u64>,
}

/// Where a message lies.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Timing {
    Before,
    Within,
    Behind,
}

impl Span {
    /// Where a message of this log time lies, in a log whose first message has the log time `first_ns`.
    pub(crate) fn timing(&self, first_ns: u64, log_ns: u64) -> Timing {
        let since_ns = log_ns.saturating_sub(first_ns);
        if since_ns < self.from_ns {
            Timing::Before
        } else if self.to_ns.is_some_and(|to_ns| since_ns > to_ns) {
            Timing::Behind
        } else {
            Timing::Within
        }
    }
}
