//! How a file of a log ends.

use crate::damage::Damage;

/// How a file ends.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Ending {
    /// As it should, with its index.
    Complete,
    /// In the middle of a record: its writer was killed, or the disk was full.
    Cut {
        /// Size of what can be read, bytes.
        offset: u64,
    },
    /// What follows cannot be read.
    Damaged(Damage),
}
