//! Committed scans as parts of a state.

use geometry::MapFromRobot;
use messages::{MAX_READINGS, Pose, UpdateRegion};
use postcard_schema::Schema;
use serde::{Deserialize, Serialize};
use state::{Packed, decode_part, encode_part};

use super::{Committed, ReadingFlags, SCANS_PER_CHUNK, StoredReading, StoredScan};
use crate::saved::{StateError, error, pose, require};

/// Longest range of a reading that is valid, m.
const LONGEST_M: f64 = 10.0;

/// Up to [`SCANS_PER_CHUNK`] scans.
#[derive(Serialize, Deserialize, Schema)]
pub(crate) struct Chunk<'a> {
    seqs: Vec<u64>,
    /// x, y (m) and yaw (rad) in the map frame.
    poses: Vec<[f64; 3]>,
    are_placed: Vec<bool>,
    /// Readings of each scan.
    counts: Vec<u8>,
    ranges_m: Packed<'a, f64>,
    flags: Vec<u32>,
    /// Scan within the chunk, and its regions: place in the robot frame (m) and size (cells).
    freed: Vec<(u32, Vec<[f64; 3]>)>,
}

impl Committed {
    /// The mounts of the sonars: x, y (m) and yaw (rad) in the robot frame.
    pub(crate) fn saved_mounts(&self) -> Vec<[f64; 3]> {
        self.mounts.poses.iter().map(|mount| [mount.x_m, mount.y_m, mount.yaw_rad]).collect()
    }

    /// An empty store with these mounts.
    pub(crate) fn with_mounts(mounts: Vec<[f64; 3]>) -> Self {
        let mut committed = Self::default();
        for [x_m, y_m, yaw_rad] in mounts {
            committed.mounts.index_of(&Pose::new(x_m, y_m, yaw_rad));
        }
        committed
    }

    /// Number of chunks.
    pub(crate) fn chunks(&self) -> usize {
        self.scans.len().div_ceil(SCANS_PER_CHUNK)
    }

    /// The chunks that have changed since this was last asked; they count as saved.
    pub(crate) fn take_unsaved(&mut self) -> impl Iterator<Item = usize> + use<> {
        std::mem::take(&mut self.unsaved).into_iter()
    }

    /// Appends a chunk to `bytes`; nothing where there is none.
    pub(crate) fn save_chunk(&self, chunk: usize, bytes: &mut Vec<u8>) {
        let indices = chunk * SCANS_PER_CHUNK..((chunk + 1) * SCANS_PER_CHUNK).min(self.scans.len());
        let Some(scans) = self.scans.get(indices.clone()).filter(|scans| !scans.is_empty()) else { return };
        let readings = self.readings_of(indices.start).start..self.readings_of(indices.end - 1).end;
        let readings = self.readings.get(readings).unwrap_or_default();
        let ranges_m: Vec<f64> = readings.iter().map(|reading| reading.range_m).collect();
        let freed = self.freed.range(indices.clone()).map(|(index, regions)| {
            let numbers = regions.iter().map(|region| [region.x_m, region.y_m, region.cells]);
            ((index - indices.start) as u32, numbers.collect())
        });
        let numbers = |it: &MapFromRobot| [it.x_m, it.y_m, it.yaw_rad];
        let saved = Chunk {
            seqs: scans.iter().map(|scan| scan.seq).collect(),
            poses: scans.iter().map(|scan| numbers(&scan.map_from_robot)).collect(),
            are_placed: scans.iter().map(|scan| scan.is_placed).collect(),
            counts: indices.clone().map(|index| self.readings_of(index).len() as u8).collect(),
            ranges_m: Packed::from(&ranges_m[..]),
            flags: readings.iter().map(|reading| reading.flags.number()).collect(),
            freed: freed.collect(),
        };
        *bytes = encode_part(&saved, std::mem::take(bytes));
    }

    /// Takes the next chunk of a state.
    ///
    /// # Errors
    /// A chunk that does not follow the last one, or a value that no reading has.
    pub(crate) fn take_chunk(&mut self, chunk: i32, bytes: &[u8]) -> Result<(), StateError> {
        let saved: Chunk<'_> = decode_part(bytes)?;
        let first = self.scans.len();
        let follows = usize::try_from(chunk).is_ok_and(|chunk| chunk * SCANS_PER_CHUNK == first);
        require(follows && saved.seqs.len() <= SCANS_PER_CHUNK, chunk, "chunks of 64 scans in their order")?;
        let lengths = [saved.poses.len(), saved.are_placed.len(), saved.counts.len()];
        require(lengths == [saved.seqs.len(); 3], format!("{lengths:?}"), "as many poses and counts as scans")?;
        let ranges_m = saved.ranges_m.into_vec();
        let total: usize = saved.counts.iter().map(|count| usize::from(*count)).sum();
        require(ranges_m.len() == total && saved.flags.len() == total, total, "as many readings as are counted")?;
        for (range_m, flags) in ranges_m.into_iter().zip(saved.flags) {
            let flags = ReadingFlags::from_number(flags);
            require((0.0..=LONGEST_M).contains(&range_m), range_m, "a range of 0 to 10 m")?;
            require(flags.mount() < self.mounts.poses.len(), flags.mount(), "a mount that is listed")?;
            self.readings.push(StoredReading { range_m, flags });
        }
        let mut readings_end = self.scans.last().map_or(0, |scan| scan.readings_end);
        let scans = saved.seqs.into_iter().zip(saved.poses).zip(saved.are_placed).zip(saved.counts);
        for (((seq, at), is_placed), count) in scans {
            let map_from_robot = pose(at)?;
            require(usize::from(count) <= MAX_READINGS, count, "at most 16 readings")?;
            require(self.scans.last().is_none_or(|last| last.seq < seq), seq, "scans in their order")?;
            readings_end += u32::from(count);
            self.scans.push(StoredScan { seq, map_from_robot, readings_end, is_placed });
        }
        for (scan, regions) in saved.freed {
            let regions: Vec<UpdateRegion> = regions.into_iter().map(|[x_m, y_m, cells]| UpdateRegion { x_m, y_m, cells }).collect();
            for region in &regions {
                region.validate().map_err(|invalid| error(invalid.to_string(), "a valid region"))?;
            }
            self.freed.insert(first + scan as usize, regions);
        }
        Ok(())
    }
}
