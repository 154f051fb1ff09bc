//! The state of a mapper as bytes, so that another process can go on from it: a head, and the committed tiles, of which few
//! change from one time to the next.
//!
//! Layout of the head, all numbers little-endian; counts are u64:
//!
//! | what | how |
//! | --- | --- |
//! | name and version | 8 bytes `SMMAP\0\0\3` |
//! | what it was made with | edge of a cell f64, limit of log-odds f32, unfiltered layer kept u32 |
//! | last scan taken | seq u64, stamp u64 |
//! | counts | scans, readings, withheld, undecided u64 |
//! | way | step f64, length f64, count, places 2 × f32 |
//! | pending scans | count, each: seq u64, stamp u64, decision, pose 3 × f64, after gap u32, readings u32, each: mount 3 × f64, range f64, sonar u32, echo u32 |
//! | early verdicts | count, each: seq u64, decision |
//! | a decision | kind u32 (0 none, 1 withhold, 2 free), then for 1 the readings u32, for 2 a count u64 of regions, each 3 × f64 |
//!
//! A tile is named by its layer (0 filtered, 1 unfiltered), row and column, and is 1024 cells f32.

use geometry::{Lattice, TileKey};
use messages::{
    FilterAction, FilterVerdict, MAX_READINGS, MAX_REGIONS, Payload, Pose, SonarReading, SonarScan, StreamCursor, UpdateRegion,
};

use crate::codec::{Decoder, Encode, StateError};
use crate::layer::Layer;
use crate::mapper::{Counts, MAX_EARLY, Mapper};
use crate::pending::{Decision, PendingScan};
use crate::way::{MAX_LENGTH_M, MAX_PLACES, Way};

const NAME_AND_VERSION: &[u8; 8] = b"SMMAP\0\0\x03";
const ALL_READINGS: u32 = (1 << MAX_READINGS) - 1;

impl Mapper {
    /// The state without its tiles. What is shown is not part of it: [`Self::refresh`] makes it anew.
    #[must_use]
    pub fn save_head(&self) -> Vec<u8> {
        let mut bytes = Vec::with_capacity(8 * self.way.places_m.len() + 1024 * (self.pending.len() + 1));
        bytes.put(NAME_AND_VERSION);
        bytes.put_f64(self.integrator.cell.metres());
        bytes.put(&self.integrator.l_max.to_le_bytes());
        bytes.put_u32(u32::from(self.unfiltered.is_some()));
        bytes.put_u64(self.last.seq);
        bytes.put_u64(self.last.stamp_ns);
        let Counts { scans, readings, withheld, undecided } = self.counts;
        [scans, readings, withheld, undecided].iter().for_each(|&count| bytes.put_u64(count));
        put_way(&mut bytes, &self.way);
        bytes.put_u64(self.pending.len() as u64);
        self.pending.iter().for_each(|scan| put_pending(&mut bytes, scan));
        bytes.put_u64(self.early.len() as u64);
        for (seq, decision) in &self.early {
            bytes.put_u64(*seq);
            put_decision(&mut bytes, Some(decision));
        }
        bytes
    }

    /// Layer, row and column of each tile of the state.
    #[must_use]
    pub fn saved_tiles(&self) -> Vec<[i32; 3]> {
        let of = |layer, tiles: &Lattice<f32>| tiles.tiles().map(|(key, _)| [layer, key.row, key.column]).collect::<Vec<_>>();
        (0..).zip(self.layers()).flat_map(|(layer, it)| of(layer, it.committed())).collect()
    }

    /// Layer, row and column of each tile that has changed since this was last asked.
    pub fn take_unsaved(&mut self) -> Vec<[i32; 3]> {
        let layers = std::iter::once(&mut self.filtered).chain(&mut self.unfiltered);
        (0..).zip(layers).flat_map(|(layer, it)| it.take_unsaved().into_iter().map(move |key| [layer, key.row, key.column])).collect()
    }

    /// Appends a tile of the state to `bytes`; nothing where there is none.
    pub fn save_tile(&self, [layer, row, column]: [i32; 3], bytes: &mut Vec<u8>) {
        let layer = usize::try_from(layer).ok().and_then(|layer| self.layers().nth(layer));
        let cells = layer.and_then(|layer| layer.committed().tile(TileKey { row, column }));
        cells.into_iter().flatten().for_each(|cell| bytes.put(&cell.to_le_bytes()));
    }

    /// This empty mapper with the state that [`Self::save_head`] gave, and [`Self::save_tile`] of each tile, under the same
    /// parameters.
    ///
    /// # Errors
    /// Bytes that no mapper with these parameters saved, with the place of the first that is wrong.
    pub fn restore<'a>(self, head: &[u8], tiles: impl IntoIterator<Item = ([i32; 3], &'a [u8])>) -> Result<Self, StateError> {
        let from = &mut Decoder::new(head);
        let mut mapper = self;
        let name = from.bytes::<8>()?;
        from.require(name == NAME_AND_VERSION, name.escape_ascii(), "SMMAP\\x00\\x00\\x03: the state of a map, version 3")?;
        let cell_m = from.f64()?;
        from.require(cell_m.to_bits() == mapper.integrator.cell.metres().to_bits(), cell_m, "the edge of a cell that is set")?;
        let l_max = from.f32()?;
        from.require(l_max.to_bits() == mapper.integrator.l_max.to_bits(), l_max, "the limit of log-odds that is set")?;
        let unfiltered = from.u32()?;
        from.require(unfiltered == u32::from(mapper.unfiltered.is_some()), unfiltered, "an unfiltered layer as it is set")?;
        mapper.last = StreamCursor { seq: from.u64()?, stamp_ns: from.u64()? };
        mapper.counts = Counts { scans: from.u64()?, readings: from.u64()?, withheld: from.u64()?, undecided: from.u64()? };
        mapper.way = take_way(from)?;
        for _ in 0..from.count(56)? {
            let scan = take_pending(from)?;
            let after = mapper.pending.back().map_or((0, 0), |before| (before.seq, before.stamp_ns));
            let in_order = scan.seq > after.0 && scan.seq <= mapper.last.seq;
            from.require(in_order, scan.seq, "pending scans in their order, up to the last one taken")?;
            from.require((after.1..=mapper.last.stamp_ns).contains(&scan.stamp_ns), scan.stamp_ns, "times in their order")?;
            mapper.pending.push_back(scan);
        }
        for _ in 0..from.count(12)? {
            let (seq, decision) = (from.u64()?, take_decision(from)?);
            let in_order = seq > mapper.early.last_key_value().map_or(mapper.last.seq, |(last, _)| *last);
            from.require(in_order && mapper.early.len() < MAX_EARLY, seq, "at most 1024 early verdicts in their order")?;
            let decision = decision.ok_or_else(|| from.error("a verdict that decides nothing".to_owned(), "a decision"))?;
            mapper.early.insert(seq, decision);
        }
        from.end()?;
        tiles.into_iter().try_for_each(|(key, bytes)| mapper.take_tile(key, bytes))?;
        Ok(mapper)
    }

    fn take_tile(&mut self, key: [i32; 3], bytes: &[u8]) -> Result<(), StateError> {
        let from = &mut Decoder::new(bytes);
        let cells = from.tile(self.integrator.l_max)?;
        from.end()?;
        let [layer, row, column] = key;
        let place = TileKey { row, column };
        let layer = match (layer, &mut self.unfiltered) {
            (0, _) => Some(&mut self.filtered),
            (1, Some(unfiltered)) => Some(unfiltered),
            _ => None,
        };
        let Some(layer) = layer.filter(|_| place.first_cell().is_some()) else {
            return Err(from.error(format!("tile {key:?}"), "a tile of a layer that is kept, within reach"));
        };
        layer.restore_tile(place, &cells);
        Ok(())
    }

    fn layers(&self) -> impl Iterator<Item = &Layer> {
        std::iter::once(&self.filtered).chain(&self.unfiltered)
    }
}

fn put_way(bytes: &mut Vec<u8>, way: &Way) {
    bytes.put_f64(way.step_m);
    bytes.put_f64(way.length_m);
    bytes.put_u64(way.places_m.len() as u64);
    way.places_m.as_flattened().iter().for_each(|number| bytes.put(&number.to_le_bytes()));
}

fn take_way(from: &mut Decoder<'_>) -> Result<Way, StateError> {
    let (step_m, length_m) = (from.f64()?, from.f64()?);
    from.require(step_m > 0.0 && step_m.is_finite(), step_m, "a step of the way above 0")?;
    from.require((0.0..=MAX_LENGTH_M).contains(&length_m), length_m, "a length of the way")?;
    let count = from.count(8)?;
    from.require(count <= MAX_PLACES, count, "at most 16384 places of the way")?;
    let mut places_m = Vec::with_capacity(count);
    for _ in 0..count {
        let place = [from.f32()?, from.f32()?];
        from.require(place.iter().all(|number| number.abs() <= 1e6), format!("{place:?}"), "a place within 1000 km")?;
        places_m.push(place);
    }
    Ok(Way::restored(step_m, length_m, places_m))
}

fn put_pose(bytes: &mut Vec<u8>, pose: &Pose) {
    [pose.x_m, pose.y_m, pose.yaw_rad].iter().for_each(|&number| bytes.put_f64(number));
}

fn take_pose(from: &mut Decoder<'_>) -> Result<Pose, StateError> {
    Ok(Pose { x_m: from.f64()?, y_m: from.f64()?, yaw_rad: from.f64()? })
}

fn put_pending(bytes: &mut Vec<u8>, pending: &PendingScan) {
    bytes.put_u64(pending.seq);
    bytes.put_u64(pending.stamp_ns);
    put_decision(bytes, pending.decision.as_ref());
    put_pose(bytes, &pending.scan.pose);
    bytes.put_u32(pending.scan.after_gap);
    bytes.put_u32(pending.scan.readings().len() as u32);
    for reading in pending.scan.readings() {
        put_pose(bytes, &reading.mount);
        bytes.put_f64(reading.range_m);
        bytes.put_u32(reading.sonar);
        bytes.put_u32(reading.echo);
    }
}

fn take_pending(from: &mut Decoder<'_>) -> Result<PendingScan, StateError> {
    let (seq, stamp_ns) = (from.u64()?, from.u64()?);
    let decision = take_decision(from)?;
    let mut scan = SonarScan { pose: take_pose(from)?, after_gap: from.u32()?, count: from.u32()?, ..SonarScan::default() };
    from.require(scan.count as usize <= MAX_READINGS, scan.count, "at most 16 readings")?;
    for reading in scan.readings.iter_mut().take(scan.count as usize) {
        *reading = SonarReading { mount: take_pose(from)?, range_m: from.f64()?, sonar: from.u32()?, echo: from.u32()? };
    }
    scan.validate().map_err(|invalid| from.error(invalid.to_string(), "a valid scan"))?;
    Ok(PendingScan { seq, stamp_ns, scan, decision, outlook: 0 })
}

fn put_decision(bytes: &mut Vec<u8>, decision: Option<&Decision>) {
    match decision {
        None => bytes.put_u32(0),
        Some(Decision::Withhold(readings)) => {
            bytes.put_u32(1);
            bytes.put_u32(*readings);
        }
        Some(Decision::Free(regions)) => {
            bytes.put_u32(2);
            bytes.put_u64(regions.len() as u64);
            for region in regions {
                [region.x_m, region.y_m, region.cells].iter().for_each(|&number| bytes.put_f64(number));
            }
        }
    }
}

fn take_decision(from: &mut Decoder<'_>) -> Result<Option<Decision>, StateError> {
    match from.u32()? {
        0 => Ok(None),
        1 => {
            let readings = from.u32()?;
            from.require(readings <= ALL_READINGS, readings, "a bit for each of 16 readings")?;
            Ok(Some(Decision::Withhold(readings)))
        }
        2 => {
            let mut verdict =
                FilterVerdict { count: from.count(24)? as u32, action: FilterAction::Free as u32, ..FilterVerdict::default() };
            from.require(verdict.count as usize <= MAX_REGIONS, verdict.count, "at most 8 regions")?;
            for region in verdict.regions.iter_mut().take(verdict.count as usize) {
                *region = UpdateRegion { x_m: from.f64()?, y_m: from.f64()?, cells: from.f64()? };
            }
            verdict.validate().map_err(|invalid| from.error(invalid.to_string(), "a valid verdict"))?;
            Ok(Some(Decision::of(&verdict)))
        }
        kind => Err(from.error(kind.to_string(), "a kind of decision from 0 to 2")),
    }
}
