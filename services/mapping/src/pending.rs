//! A scan within the commit horizon.

use geometry::{MapFromOdom, MapFromRobot, OdomFromRobot};
use messages::{FilterAction, FilterVerdict, SmoothedPose, SonarScan, UpdateRegion};

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
    /// The robot as it is known so far.
    pub(crate) map_from_robot: MapFromRobot,
    /// Whether that pose is known at all.
    pub(crate) is_placed: bool,
    /// Whether it is the pose by which the scan is integrated.
    pub(crate) is_smoothed: bool,
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
    /// A scan without verdict. Odometry is exact until an estimate comes: both frames are the same.
    pub(crate) fn new(seq: u64, stamp_ns: u64, scan: SonarScan, decision: Option<Decision>) -> Self {
        let map_from_robot = MapFromRobot::from_wire(&scan.pose);
        Self { seq, stamp_ns, scan, decision, outlook: 0, map_from_robot, is_placed: true, is_smoothed: false }
    }

    /// Places the scan by the odometry frame as it is estimated now.
    pub(crate) fn locate(&mut self, map_from_odom: &MapFromOdom, is_lost: bool) {
        if !self.is_smoothed {
            self.map_from_robot = map_from_odom.then(&OdomFromRobot::of_scan(&self.scan));
            self.is_placed = !is_lost;
        }
    }

    /// Places the scan for good.
    pub(crate) fn smooth(&mut self, smoothed: &SmoothedPose) {
        self.map_from_robot = MapFromRobot::from_wire(&smoothed.map_from_robot);
        (self.is_placed, self.is_smoothed) = (smoothed.is_placed != 0, true);
    }

    /// The regions that the verdict sets free, in the robot frame.
    pub(crate) fn freed_in_robot(&self) -> Vec<UpdateRegion> {
        let robot_from_odom = OdomFromRobot::of_scan(&self.scan).inverse();
        let place = |region: &UpdateRegion| {
            let [x_m, y_m] = robot_from_odom.apply([region.x_m, region.y_m]);
            UpdateRegion { x_m, y_m, cells: region.cells }
        };
        self.freed().iter().map(place).collect()
    }

    pub(crate) fn beams(&self) -> impl Iterator<Item = Beam<'_>> {
        self.scan.readings().iter().map(|reading| Beam { map_from_robot: &self.map_from_robot, reading })
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
