//! `map/verdict`, `map/outlook`, `motion/walkers`: what fuzzy-tuned integration says of readings and of walkers.

use crate::layout::plain;
use crate::service::{at_most, within};
use crate::{Invalid, MAX_READINGS};

/// Most update regions in one verdict.
pub const MAX_REGIONS: usize = 8;
/// Most scans in one outlook.
pub const MAX_OUTLOOK_SCANS: usize = 128;
/// Most walkers in one message.
pub const MAX_TRACKED_WALKERS: usize = 16;

plain! {
    /// The region a moving thing covers (`O_Centroid`, `O_Size` of the paper's Tables 3 to 5), in the map frame.
    pub struct UpdateRegion {
        /// Centre, m.
        pub x_m: f64,
        /// Centre, m.
        pub y_m: f64,
        /// Size in cells.
        pub cells: f64,
    }

    /// The final answer of FTI on one scan; its sequence number is the scan's.
    pub struct FilterVerdict {
        /// The first `count` entries are regions, the rest is zero.
        pub regions: [UpdateRegion; MAX_REGIONS] => count,
        /// Number of regions.
        pub count: u32,
        /// Bit i set: the occupied part of reading i is left out of the map.
        pub withheld: u32,
        /// Bit 0: rests on the sonar's motion; bit 1: on the camera's.
        pub inputs: u32,
        /// [`FilterAction`] as a number.
        pub action: u32,
    }

    /// The verdict on one pending scan if it were given now.
    pub struct OutlookScan {
        /// The scan's number.
        pub seq: u64,
        /// Bit i set: the occupied part of reading i would be left out of the map.
        pub withheld: u32,
        /// Always 0.
        pub reserved: u32,
    }

    /// The verdicts to come as they stand: for what is shown, not for what is integrated for good.
    pub struct VerdictOutlook {
        /// The first `count` entries are scans in ascending order, the rest is zero.
        pub scans: [OutlookScan; MAX_OUTLOOK_SCANS] => count,
        /// Number of scans.
        pub count: u32,
        /// Always 0.
        pub reserved: u32,
    }

    /// A walker who is followed, in the map frame.
    pub struct TrackedWalker {
        /// Place, m.
        pub x_m: f64,
        /// Place, m.
        pub y_m: f64,
        /// Velocity, m/s.
        pub velocity_x_m_s: f64,
        /// Velocity, m/s.
        pub velocity_y_m_s: f64,
        /// Identity, from 1; never used again in a run.
        pub track: u64,
    }

    /// The walkers that are followed at the time of a scan; its sequence number is the scan's.
    pub struct Walkers {
        /// The first `count` entries are walkers, the rest is zero.
        pub walkers: [TrackedWalker; MAX_TRACKED_WALKERS] => count,
        /// Number of walkers.
        pub count: u32,
        /// Always 0.
        pub reserved: u32,
    }
}

/// What becomes of a place where something moves.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u32)]
pub enum FilterAction {
    /// The readings of `withheld` leave their occupied part out of the map.
    Withhold = 0,
    /// The cells of the regions are set free when the scan is integrated (the paper's action).
    Free = 1,
}

impl VerdictOutlook {
    /// The scans of this outlook, in ascending order.
    #[must_use]
    pub fn scans(&self) -> &[OutlookScan] {
        &self.scans[..(self.count as usize).min(MAX_OUTLOOK_SCANS)]
    }
}

impl Walkers {
    /// The walkers of this message.
    #[must_use]
    pub fn walkers(&self) -> &[TrackedWalker] {
        &self.walkers[..(self.count as usize).min(MAX_TRACKED_WALKERS)]
    }
}

impl FilterVerdict {
    /// Bit of `inputs`: the verdict rests on the sonar's motion.
    pub const FROM_SONAR: u32 = 1;
    /// Bit of `inputs`: the verdict rests on the camera's motion.
    pub const FROM_CAMERA: u32 = 2;

    /// The regions of this verdict.
    #[must_use]
    pub fn regions(&self) -> &[UpdateRegion] {
        &self.regions[..(self.count as usize).min(MAX_REGIONS)]
    }

    /// Whether the occupied part of reading `index` is left out.
    #[must_use]
    pub fn withholds(&self, index: usize) -> bool {
        index < MAX_READINGS && self.withheld & (1 << index) != 0
    }
}

impl UpdateRegion {
    /// Whether its numbers can be meant.
    ///
    /// # Errors
    /// The first that cannot.
    pub fn validate(&self) -> Result<(), Invalid> {
        within("regions.x_m", self.x_m, -1e6, 1e6, "at most 1000 km from the origin")?;
        within("regions.y_m", self.y_m, -1e6, 1e6, "at most 1000 km from the origin")?;
        within("regions.cells", self.cells, 0.0, 1e6, "0 to 1000000 cells")
    }
}

impl FilterVerdict {
    pub(crate) fn check(&self) -> Result<(), Invalid> {
        at_most("count", self.count, MAX_REGIONS, "at most 8")?;
        at_most("withheld", self.withheld, (1 << MAX_READINGS) - 1, "a bit for each of 16 readings")?;
        at_most("inputs", self.inputs, 3, "0 to 3")?;
        at_most("action", self.action, 1, "0 or 1")?;
        for region in self.regions() {
            region.validate()?;
        }
        Ok(())
    }
}

impl VerdictOutlook {
    pub(crate) fn check(&self) -> Result<(), Invalid> {
        at_most("count", self.count, MAX_OUTLOOK_SCANS, "at most 128")?;
        for scan in self.scans() {
            at_most("scans.withheld", scan.withheld, (1 << MAX_READINGS) - 1, "a bit for each of 16 readings")?;
        }
        Ok(())
    }
}

impl Walkers {
    pub(crate) fn check(&self) -> Result<(), Invalid> {
        at_most("count", self.count, MAX_TRACKED_WALKERS, "at most 16")?;
        for walker in self.walkers() {
            within("walkers.x_m", walker.x_m, -1e6, 1e6, "at most 1000 km from the origin")?;
            within("walkers.y_m", walker.y_m, -1e6, 1e6, "at most 1000 km from the origin")?;
            within("walkers.velocity_x_m_s", walker.velocity_x_m_s, -100.0, 100.0, "at most 100 m/s")?;
            within("walkers.velocity_y_m_s", walker.velocity_y_m_s, -100.0, 100.0, "at most 100 m/s")?;
        }
        Ok(())
    }
}
