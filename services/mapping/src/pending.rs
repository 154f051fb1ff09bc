//! A scan within the commit horizon.

use messages::SonarScan;

use crate::integrate::Beam;

/// A scan that is shown, but not yet integrated for good.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct PendingScan {
    pub(crate) seq: u64,
    pub(crate) stamp_ns: u64,
    pub(crate) scan: SonarScan,
    /// The verdict, once it is there: bit i set when the occupied part of reading i is left out.
    pub(crate) withheld: Option<u32>,
}

impl PendingScan {
    pub(crate) fn beams(&self) -> impl Iterator<Item = Beam<'_>> {
        self.scan.readings().iter().map(|reading| Beam { map_from_robot: &self.scan.pose, reading })
    }

    /// Whether the occupied part of reading `index` is left out, as things stand.
    pub(crate) fn withholds(&self, index: usize) -> bool {
        self.withheld.is_some_and(|bits| bits & (1 << index) != 0)
    }

    /// Number of readings whose occupied part is left out, as things stand.
    pub(crate) fn withheld_count(&self) -> u64 {
        (0..self.scan.readings().len()).filter(|&index| self.withholds(index)).count() as u64
    }
}
