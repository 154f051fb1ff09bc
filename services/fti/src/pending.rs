//! Scans whose readings wait for their verdict, or got it lately.

use geometry::Beam;
use geometry::Cell;
use messages::{FilterVerdict, MAX_READINGS, MAX_REGIONS};
use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

use crate::region::Region;

/// One reading.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, Schema)]
pub(crate) struct PendingReading {
    pub(crate) beam: Beam,
    /// The run of its sonar that it belongs to; 0: no echo.
    pub(crate) run: u64,
    /// Cells of its arc.
    pub(crate) arc: Vec<Cell>,
    /// S by the past alone, when it came.
    pub(crate) past: f64,
    /// Whether the camera looked at where it came from.
    pub(crate) watched: bool,
    /// How far its echo counts as a hit of something that stands, by what was known at its verdict.
    pub(crate) weight: f64,
}

/// One scan.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, Schema)]
pub(crate) struct PendingScan {
    pub(crate) seq: u64,
    pub(crate) stamp_ns: u64,
    /// The robot, x and y in the map frame, m.
    pub(crate) robot_m: [f64; 2],
    pub(crate) readings: Vec<PendingReading>,
    /// Update regions of its corresponding pairs.
    pub(crate) regions: Vec<Region>,
    /// The inputs that came for it, as in `FilterVerdict`.
    pub(crate) inputs: u32,
}

impl PendingScan {
    /// Whether its verdict can be given.
    pub(crate) fn is_possible(&self) -> bool {
        let regions_are = self.regions.iter().take(MAX_REGIONS).all(|region| region.message().validate().is_ok());
        let inputs = FilterVerdict::FROM_SONAR | FilterVerdict::FROM_CAMERA;
        self.readings.len() <= MAX_READINGS && regions_are && self.inputs & !inputs == 0
    }
}
