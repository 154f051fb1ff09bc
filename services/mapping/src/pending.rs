//! A scan within the commit horizon.

use messages::{FilterAction, FilterVerdict, SonarScan, UpdateRegion};

use crate::integrate::Beam;

/// A scan that is shown, but not yet integrated for good.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct PendingScan {
    pub(crate) seq: u64,
    pub(crate) stamp_ns: u64,
    pub(crate) scan: SonarScan,
    /// The verdict, once it is there.
    pub(crate) decision: Option<Decision>,
    /// What the verdict is expected to be: bit i set when the occupied part of reading i will be left out.
    pub(crate) outlook: u32,
}

/// What a verdict does to the map.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Decision {
    /// Bit i set: the occupied part of reading i is left out.
    Withhold(u32),
    /// The readings are integrated whole, then the cells of these regions are set free.
    Free(Vec<UpdateRegion>),
}

impl Decision {
    pub(crate) fn of(verdict: &FilterVerdict) -> Self {
        if verdict.action == FilterAction::Free as u32 { Self::Free(verdict.regions().to_vec()) } else { Self::Withhold(verdict.withheld) }
    }
}

impl PendingScan {
    pub(crate) fn beams(&self) -> impl Iterator<Item = Beam<'_>> {
        self.scan.readings().iter().map(|reading| Beam { map_from_robot: &self.scan.pose, reading })
    }

    /// The readings whose occupied part is left out for good; where there is no verdict, none.
    pub(crate) fn withheld(&self) -> u32 {
        match self.decision {
            Some(Decision::Withhold(readings)) => readings,
            Some(Decision::Free(_)) | None => 0,
        }
    }

    /// The readings whose occupied part is left out as things stand.
    pub(crate) fn withheld_so_far(&self) -> u32 {
        if self.decision.is_some() { self.withheld() } else { self.outlook }
    }

    /// The regions whose cells the verdict sets free.
    pub(crate) fn freed(&self) -> &[UpdateRegion] {
        match &self.decision {
            Some(Decision::Free(regions)) => regions,
            Some(Decision::Withhold(_)) | None => &[],
        }
    }

    /// Number of readings whose occupied part is left out for good.
    pub(crate) fn withheld_count(&self) -> u64 {
        u64::from((self.withheld() & ((1_u32 << self.scan.readings().len()) - 1)).count_ones())
    }
}
