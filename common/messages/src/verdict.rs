//! `map/verdict`, `map/outlook`, `motion/walkers`: the results of fuzzy-tuned integration (FTI) on readings and walkers.

use crate::layout::plain;
use crate::numbered::numbered;
use crate::service::{at_most, within};
use crate::{Invalid, MAX_READINGS};

/// Most update regions in one verdict.
///
/// ```
/// use stillmap_messages::{FilterVerdict, MAX_REGIONS};
///
/// assert_eq!(FilterVerdict::default().regions.len(), MAX_REGIONS);
/// ```
pub const MAX_REGIONS: usize = 8;
/// Most scans in one outlook.
///
/// ```
/// use stillmap_messages::{MAX_OUTLOOK_SCANS, VerdictOutlook};
///
/// assert_eq!(VerdictOutlook::default().scans.len(), MAX_OUTLOOK_SCANS);
/// ```
pub const MAX_OUTLOOK_SCANS: usize = 128;
/// Most walkers in one message.
///
/// ```
/// use stillmap_messages::{MAX_TRACKED_WALKERS, Walkers};
///
/// assert_eq!(Walkers::default().walkers.len(), MAX_TRACKED_WALKERS);
/// ```
pub const MAX_TRACKED_WALKERS: usize = 16;

plain! {
    /// The region a moving thing covers (`O_Centroid`, `O_Size` of the paper's Tables 3 to 5), in the odom frame.
    ///
    /// ```
    /// use stillmap_messages::UpdateRegion;
    ///
    /// assert_eq!(UpdateRegion { x_m: 1.0, y_m: 2.0, cells: 40.0 }.validate(), Ok(()));
    /// ```
    pub struct UpdateRegion {
        /// Centre, m.
        pub x_m: f64,
        /// Centre, m.
        pub y_m: f64,
        /// Size in cells.
        pub cells: f64,
    }

    /// The final verdict of FTI on a scan. It has the sequence number of the scan.
    ///
    /// ```
    /// use stillmap_messages::FilterVerdict;
    ///
    /// let verdict = FilterVerdict { withheld: 0b10, inputs: FilterVerdict::FROM_SONAR, ..FilterVerdict::default() };
    /// assert!(verdict.withholds(1) && !verdict.withholds(0));
    /// ```
    pub struct FilterVerdict {
        /// The first `count` entries are regions, the rest is zero.
        pub regions: [UpdateRegion; MAX_REGIONS] => count,
        /// Number of regions.
        pub count: u32,
        /// Bit i set: the occupied part of reading i is left out of the map.
        pub withheld: u32,
        /// Bit 0: it uses motion from the sonars; bit 1: motion from the camera.
        pub inputs: u32,
        /// [`FilterAction`] as a number.
        pub action: u32,
    }

    /// The verdict on a pending scan if it were given now.
    ///
    /// ```
    /// use stillmap_messages::OutlookScan;
    ///
    /// assert_eq!(OutlookScan { seq: 12, withheld: 0b1, reserved: 0 }.withheld.count_ones(), 1);
    /// ```
    pub struct OutlookScan {
        /// The scan's number.
        pub seq: u64,
        /// Bit i set: the occupied part of reading i would be left out of the map.
        pub withheld: u32,
        /// Always 0.
        pub reserved: u32,
    }

    /// The pending verdicts as they stand. They change what is shown, never what is integrated.
    ///
    /// ```
    /// use stillmap_messages::{OutlookScan, VerdictOutlook};
    ///
    /// let mut outlook = VerdictOutlook { count: 1, ..VerdictOutlook::default() };
    /// outlook.scans[0] = OutlookScan { seq: 12, withheld: 0b1, reserved: 0 };
    /// assert_eq!(outlook.scans().len(), 1);
    /// ```
    pub struct VerdictOutlook {
        /// The first `count` entries are scans in ascending order, the rest is zero.
        pub scans: [OutlookScan; MAX_OUTLOOK_SCANS] => count,
        /// Number of scans.
        pub count: u32,
        /// Always 0.
        pub reserved: u32,
    }

    /// A tracked walker, in the odom frame.
    ///
    /// ```
    /// use stillmap_messages::TrackedWalker;
    ///
    /// let walker = TrackedWalker { x_m: 2.0, y_m: 0.5, velocity_x_m_s: 0.9, velocity_y_m_s: 0.0, track: 1 };
    /// assert_eq!(walker.track, 1);
    /// ```
    pub struct TrackedWalker {
        /// Position, m.
        pub x_m: f64,
        /// Position, m.
        pub y_m: f64,
        /// Velocity, m/s.
        pub velocity_x_m_s: f64,
        /// Velocity, m/s.
        pub velocity_y_m_s: f64,
        /// Identity of the track, from 1; unique in a run.
        pub track: u64,
    }

    /// The walkers that are tracked at the time of a scan. It has the sequence number of the scan.
    ///
    /// ```
    /// use stillmap_messages::{TrackedWalker, Walkers};
    ///
    /// let mut walkers = Walkers { count: 1, ..Walkers::default() };
    /// walkers.walkers[0] = TrackedWalker { x_m: 2.0, track: 1, ..TrackedWalker::default() };
    /// assert_eq!(walkers.walkers().len(), 1);
    /// ```
    pub struct Walkers {
        /// The first `count` entries are walkers, the rest is zero.
        pub walkers: [TrackedWalker; MAX_TRACKED_WALKERS] => count,
        /// Number of walkers.
        pub count: u32,
        /// Always 0.
        pub reserved: u32,
    }
}

numbered! {
    /// How a verdict changes the map.
    ///
    /// ```
    /// use stillmap_messages::{FilterAction, FilterVerdict};
    ///
    /// assert_eq!(FilterAction::from_number(FilterVerdict::default().action), Some(FilterAction::Withhold));
    /// ```
    pub enum FilterAction {
        /// The occupied part of the readings in `withheld` is left out.
        Withhold = 0,
        /// The cells of the regions are set free when the scan is integrated (the paper's action).
        Free = 1,
    }
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
    /// Bit of `inputs`: the verdict uses motion from the sonars.
    pub const FROM_SONAR: u32 = 1;
    /// Bit of `inputs`: the verdict uses motion from the camera.
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
    /// Checks that its numbers are in range.
    ///
    /// # Errors
    /// The first number that is not.
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
