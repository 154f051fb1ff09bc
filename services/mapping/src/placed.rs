//! A scan at its pose in the map.

use geometry::MapFromRobot;
use messages::{SonarReading, UpdateRegion};

use crate::integrate::Beam;

/// What a scan says of the map once it is decided.
#[derive(Debug, Clone, Copy)]
pub(crate) struct PlacedScan<'a> {
    pub(crate) map_from_robot: MapFromRobot,
    pub(crate) readings: &'a [SonarReading],
    /// Bit i set: the occupied part of reading i is left out.
    pub(crate) withheld: u32,
    /// Regions of the map whose cells are set free.
    pub(crate) freed: &'a [UpdateRegion],
}

impl PlacedScan<'_> {
    pub(crate) fn beams(&self) -> impl Iterator<Item = Beam<'_>> {
        self.readings.iter().map(|reading| Beam { map_from_robot: &self.map_from_robot, reading })
    }
}
