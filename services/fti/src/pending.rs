//! Scans whose readings wait for their verdict, or got it lately.

use geometry::Beam;
use geometry::Cell;
use messages::{FilterVerdict, MAX_READINGS, MAX_REGIONS};
use serde::{Deserialize, Serialize};

use crate::region::Region;

/// One reading.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct PendingReading {
    pub(crate) beam: Beam,
    /// The run of its sonar that it belongs to; 0: no echo.
    pub(crate) run: u64,
    /// Cells of its arc, row and column.
    #[serde(with = "cells")]
    pub(crate) arc: Vec<Cell>,
    /// S by the past alone, when it came.
    pub(crate) past: f64,
    /// Whether the camera looked at where it came from.
    pub(crate) watched: bool,
    /// How far its echo counts as a hit of something that stands, by what was known at its verdict.
    pub(crate) weight: f64,
}

/// One scan.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
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

mod cells {
    use geometry::Cell;
    use serde::{Deserialize, Deserializer, Serialize, Serializer};

    pub(super) fn serialize<S: Serializer>(cells: &[Cell], serializer: S) -> Result<S::Ok, S::Error> {
        cells.iter().map(|cell| (cell.row, cell.column)).collect::<Vec<_>>().serialize(serializer)
    }

    pub(super) fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Vec<Cell>, D::Error> {
        let cells = Vec::<(i32, i32)>::deserialize(deserializer)?;
        Ok(cells.into_iter().map(|(row, column)| Cell { row, column }).collect())
    }
}
