//! Every scan that was integrated for good, so that the map can be rendered again when its poses are revised.
//!
//! A scan takes 40 bytes and a reading 16: 2.9 MB an hour at 10 scans and 25 readings a second. Ranges and poses are as they were
//! received, so that a map that is rendered again with the same poses is the same to the byte.

mod chunk;

use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::ops::Range;

use geometry::MapFromRobot;
use messages::{MAX_READINGS, MovedStretch, Pose, SonarReading, UpdateRegion};

pub(crate) use chunk::Chunk;

use crate::placed::PlacedScan;

/// Scans in one part of a checkpoint: as many as come between two checkpoints, so that most parts are written once.
pub(crate) const SCANS_PER_CHUNK: usize = 64;

/// Scans by their number, with poses that can be revised.
#[derive(Debug, Clone, Default)]
pub(crate) struct Committed {
    scans: Vec<StoredScan>,
    readings: Vec<StoredReading>,
    mounts: Mounts,
    /// By the index of the scan: the regions that its verdict set free, in the robot frame.
    freed: BTreeMap<usize, Vec<UpdateRegion>>,
    /// Chunks that have changed since they were last saved.
    unsaved: BTreeSet<usize>,
}

#[derive(Debug, Clone, Copy)]
struct StoredScan {
    seq: u64,
    map_from_robot: MapFromRobot,
    /// Where its readings end among all.
    readings_end: u32,
    is_placed: bool,
}

#[derive(Debug, Clone, Copy)]
struct StoredReading {
    range_m: f64,
    flags: ReadingFlags,
}

/// Mount, echo and verdict of a reading.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct ReadingFlags(u32);

impl ReadingFlags {
    fn new(mount: u32, has_echo: bool, is_withheld: bool) -> Self {
        Self(mount << 2 | u32::from(has_echo) << 1 | u32::from(is_withheld))
    }

    pub(crate) fn from_number(number: u32) -> Self {
        Self(number)
    }

    pub(crate) fn number(self) -> u32 {
        self.0
    }

    pub(crate) fn mount(self) -> usize {
        (self.0 >> 2) as usize
    }

    fn has_echo(self) -> bool {
        self.0 & 2 != 0
    }

    fn is_withheld(self) -> bool {
        self.0 & 1 != 0
    }
}

/// The mounts of all sonars, in the order in which they first occurred.
#[derive(Debug, Clone, Default)]
struct Mounts {
    poses: Vec<Pose>,
    index: HashMap<[u64; 3], u32>,
}

impl Mounts {
    fn index_of(&mut self, mount: &Pose) -> u32 {
        let bits = [mount.x_m, mount.y_m, mount.yaw_rad].map(f64::to_bits);
        let poses = &mut self.poses;
        *self.index.entry(bits).or_insert_with(|| {
            poses.push(*mount);
            poses.len() as u32 - 1
        })
    }
}

/// A scan as it is committed.
#[derive(Debug, Clone, Copy)]
pub(crate) struct NewScan<'a> {
    pub(crate) seq: u64,
    pub(crate) map_from_robot: MapFromRobot,
    /// Whether its pose is known. A scan without a pose is in no map.
    pub(crate) is_placed: bool,
    pub(crate) readings: &'a [SonarReading],
    /// Bit i set: the occupied part of reading i is left out.
    pub(crate) withheld: u32,
    /// The regions that its verdict sets free, in the robot frame.
    pub(crate) freed: &'a [UpdateRegion],
}

impl Committed {
    /// Number of scans.
    pub(crate) fn len(&self) -> usize {
        self.scans.len()
    }

    /// Appends a scan.
    pub(crate) fn push(&mut self, scan: NewScan<'_>) {
        let NewScan { seq, map_from_robot, is_placed, readings, withheld, freed } = scan;
        for (index, reading) in readings.iter().enumerate() {
            let flags = ReadingFlags::new(self.mounts.index_of(&reading.mount), reading.echo != 0, withheld & (1 << index) != 0);
            self.readings.push(StoredReading { range_m: reading.range_m, flags });
        }
        let index = self.scans.len();
        self.scans.push(StoredScan { seq, map_from_robot, readings_end: self.readings.len() as u32, is_placed });
        if !freed.is_empty() {
            self.freed.insert(index, freed.to_vec());
        }
        self.unsaved.insert(index / SCANS_PER_CHUNK);
    }

    /// Calls `draw` with a scan, unless its pose is not known.
    pub(crate) fn draw(&self, index: usize, mut draw: impl FnMut(&PlacedScan<'_>)) {
        let Some(scan) = self.scans.get(index).filter(|scan| scan.is_placed) else { return };
        let mut readings = [SonarReading::default(); MAX_READINGS];
        let mut withheld = 0;
        let stored = self.readings.get(self.readings_of(index)).unwrap_or_default();
        for (at, (reading, stored)) in readings.iter_mut().zip(stored).enumerate() {
            let mount = self.mounts.poses.get(stored.flags.mount()).copied().unwrap_or_default();
            *reading = SonarReading::new(0, mount, stored.range_m, stored.flags.has_echo());
            withheld |= u32::from(stored.flags.is_withheld()) << at;
        }
        let freed: Vec<UpdateRegion> = self.freed.get(&index).into_iter().flatten().map(|it| in_map(&scan.map_from_robot, it)).collect();
        let readings = &readings[..stored.len().min(MAX_READINGS)];
        draw(&PlacedScan { map_from_robot: scan.map_from_robot, readings, withheld, freed: &freed });
    }

    /// Moves the scans of a stretch.
    pub(crate) fn revise(&mut self, moved: &MovedStretch) {
        let from = self.scans.partition_point(|scan| scan.seq < moved.first);
        let to = self.scans.partition_point(|scan| scan.seq <= moved.last).max(from);
        for scan in &mut self.scans[from..to] {
            scan.map_from_robot = revised(moved, &scan.map_from_robot);
            scan.is_placed = true;
        }
        self.unsaved.extend((from..to).map(|index| index / SCANS_PER_CHUNK));
    }

    /// The robot at each scan whose pose is known, in their order.
    pub(crate) fn poses(&self) -> impl Iterator<Item = &MapFromRobot> {
        self.scans.iter().filter(|scan| scan.is_placed).map(|scan| &scan.map_from_robot)
    }

    fn readings_of(&self, index: usize) -> Range<usize> {
        let end = |index: usize| self.scans.get(index).map_or(0, |scan| scan.readings_end as usize);
        index.checked_sub(1).map_or(0, end)..end(index)
    }
}

/// A pose of a stretch after its revision: it keeps its place relative to the first scan.
pub(crate) fn revised(moved: &MovedStretch, map_from_robot: &MapFromRobot) -> MapFromRobot {
    let (before, now) = (MapFromRobot::from_wire(&moved.before), MapFromRobot::from_wire(&moved.now));
    now.then(&before.inverse().then(map_from_robot))
}

fn in_map(map_from_robot: &MapFromRobot, region: &UpdateRegion) -> UpdateRegion {
    let [x_m, y_m] = map_from_robot.apply([region.x_m, region.y_m]);
    UpdateRegion { x_m, y_m, cells: region.cells }
}
