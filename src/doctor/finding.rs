//! What a check of the computer finds.

/// What one check has found.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Finding {
    /// Nothing to do.
    Well(String),
    /// A run is possible, and something may go wrong.
    Doubtful { found: String, remedy: String },
    /// A run is not possible.
    Fault { found: String, remedy: String },
}
