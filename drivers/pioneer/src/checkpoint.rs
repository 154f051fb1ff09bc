//! What a restarted driver needs to resume: plain numbers, of the same build.

use messages::SonarScan;
use psos::{MODELS, Model};

use crate::odometry::Track;

/// A scan with its place in the stream, and the state of the session after it.
///
/// It is saved before the scan is sent. A process killed in between sends the scan again, which readers that have it drop.
#[derive(Debug, Clone, Copy, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub struct Checkpoint {
    /// Place of the scan in the stream, from 1.
    pub seq: u64,
    /// Arrival of its packet, ns.
    pub stamp_ns: u64,
    /// The scan.
    pub scan: SonarScan,
    /// Where the robot is.
    pub track: Track,
    /// Place of the robot's model among [`psos::MODELS`].
    model: u32,
    /// Baud rate of the link.
    pub baud: u32,
}

impl Checkpoint {
    pub(crate) fn new(seq: u64, stamp_ns: u64, scan: SonarScan, track: Track, model: &'static Model, baud: u32) -> Self {
        let model = MODELS.iter().position(|known| known == model).unwrap_or(0) as u32;
        Self { seq, stamp_ns, scan, track, model, baud }
    }

    /// The model of the robot.
    #[must_use]
    pub fn model(&self) -> &'static Model {
        MODELS.get(self.model as usize).unwrap_or(&MODELS[0])
    }

    /// The bytes to keep.
    #[must_use]
    pub fn as_bytes(&self) -> &[u8] {
        bytemuck::bytes_of(self)
    }

    /// The checkpoint in kept bytes; `None` when they are none of this build.
    #[must_use]
    pub fn from_bytes(bytes: &[u8]) -> Option<Self> {
        bytemuck::try_pod_read_unaligned(bytes).ok()
    }
}
