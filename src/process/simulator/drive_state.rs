//! What a simulator saves: how far the drive has come.

use serde::{Deserialize, Serialize};
use state::Schema;

/// How far the drive has come.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, Schema)]
pub(super) struct DriveState {
    /// Packets made of the drive.
    pub(super) packets: u64,
    /// Packets sent to a client.
    pub(super) sent: u64,
}
