//! The state of a mapper as bytes, so that another process can resume from it: a head, and parts, of which few change from one time to
//! the next. A part is a committed tile, named by its layer (0 filtered, 1 unfiltered), row and column, or a chunk of committed scans,
//! named by [`CHUNKS`], its number and 0.

use std::collections::BTreeSet;

use geometry::{Lattice, TILE_CELLS, Tile, TileKey};
use messages::{FilterAction, FilterVerdict, MAX_READINGS, MAX_REGIONS, Payload, SonarScan, StreamCursor, UpdateRegion};
use postcard_schema::Schema;
use serde::{Deserialize, Serialize};
use state::{InParts, Packed, decode, decode_part, encode, encode_part};

use crate::committed::Chunk;
use crate::layer::Layer;
use crate::localised::Localised;
use crate::localised_state::SavedLocalised;
use crate::mapper::{Counts, MAX_EARLY, Mapper};
use crate::pending::{Decision, PendingScan};
use crate::saved::{SavedPath, StateError, error, pose, require};

/// The layer of chunks in the names of parts.
const CHUNKS: i32 = 2;
const ALL_READINGS: u32 = (1 << MAX_READINGS) - 1;

#[derive(Serialize, Deserialize, Schema)]
struct Head<'a> {
    /// Edge of a cell, m.
    cell_m: f64,
    /// Limit of the log-odds.
    l_max: f32,
    unfiltered: bool,
    last: StreamCursor,
    counts: Counts,
    path: SavedPath<'a>,
    pending: Vec<SavedScan>,
    early: Vec<(u64, SavedDecision)>,
    tiles: InParts<Packed<'a, f32>>,
    /// Layer, row and column of tiles that a viewer may hold and that are not committed: parts of these names are out of date.
    uncommitted: Vec<[i32; 3]>,
    localised: Option<SavedLocalised<'a>>,
    chunks: InParts<Chunk<'a>>,
}

#[derive(Serialize, Deserialize, Schema)]
struct SavedScan {
    at: StreamCursor,
    #[serde(with = "messages::payload_bytes")]
    scan: SonarScan,
    decision: Option<SavedDecision>,
    map_from_robot: [f64; 3],
    is_placed: bool,
    is_smoothed: bool,
}

#[derive(Serialize, Deserialize, Schema)]
enum SavedDecision {
    Withhold(u32),
    /// Place and size of each region.
    Free(Vec<[f64; 3]>),
}

impl Mapper {
    /// The state without its tiles. What is shown is not part of it: [`Self::refresh`] makes it anew.
    #[must_use]
    pub fn save_head(&self) -> Vec<u8> {
        let pending = self.pending.iter().map(|it| SavedScan {
            at: StreamCursor { seq: it.seq, stamp_ns: it.stamp_ns },
            scan: it.scan,
            decision: it.decision.as_ref().map(SavedDecision::from),
            map_from_robot: [it.map_from_robot.x_m, it.map_from_robot.y_m, it.map_from_robot.yaw_rad],
            is_placed: it.is_placed,
            is_smoothed: it.is_smoothed,
        });
        let head = Head {
            cell_m: self.integrator.cell.metres(),
            l_max: self.integrator.l_max,
            unfiltered: self.unfiltered.is_some(),
            last: self.last,
            counts: self.counts,
            path: SavedPath::from(&self.path),
            pending: pending.collect(),
            early: self.early.iter().map(|(seq, decision)| (*seq, decision.into())).collect(),
            tiles: InParts::default(),
            uncommitted: (0..)
                .zip(self.layers())
                .flat_map(|(layer, it)| it.uncommitted().map(move |key| [layer, key.row, key.column]))
                .collect(),
            localised: self.localised.as_ref().map(Localised::save),
            chunks: InParts::default(),
        };
        encode(&head, Vec::new())
    }

    /// The names of all parts of the state.
    #[must_use]
    pub fn saved_parts(&self) -> Vec<[i32; 3]> {
        let of = |layer, tiles: &Lattice<f32>| tiles.tiles().map(|(key, _)| [layer, key.row, key.column]).collect::<Vec<_>>();
        let chunks = self.localised.iter().flat_map(|it| 0..it.committed.chunks()).map(chunk_name);
        (0..).zip(self.layers()).flat_map(|(layer, it)| of(layer, it.committed())).chain(chunks).collect()
    }

    /// The names of the parts that have changed since this was last asked.
    pub fn take_unsaved(&mut self) -> Vec<[i32; 3]> {
        let layers = std::iter::once(&mut self.filtered).chain(&mut self.unfiltered);
        let tiles = (0..).zip(layers).flat_map(|(layer, it)| it.take_unsaved().into_iter().map(move |key| [layer, key.row, key.column]));
        let chunks = self.localised.iter_mut().flat_map(|it| it.committed.take_unsaved()).map(chunk_name);
        tiles.chain(chunks).collect()
    }

    /// Appends a part of the state to `bytes`; nothing where there is none.
    pub fn save_part(&self, [layer, row, column]: [i32; 3], bytes: &mut Vec<u8>) {
        if let (CHUNKS, Some(localised), Ok(chunk)) = (layer, &self.localised, usize::try_from(row)) {
            return localised.committed.save_chunk(chunk, bytes);
        }
        let layer = usize::try_from(layer).ok().and_then(|layer| self.layers().nth(layer));
        if let Some(cells) = layer.and_then(|layer| layer.committed().tile(TileKey { row, column })) {
            *bytes = encode_part(&Packed::from(&cells[..]), std::mem::take(bytes));
        }
    }

    /// This empty mapper with the state that [`Self::save_head`] gave, and [`Self::save_part`] of each part, under the same
    /// parameters.
    ///
    /// # Errors
    /// Bytes that no mapper with these parameters saved.
    pub fn restore<'a>(self, head: &[u8], parts: impl IntoIterator<Item = ([i32; 3], &'a [u8])>) -> Result<Self, StateError> {
        let head: Head<'_> = decode(head)?;
        let mut mapper = self;
        require(head.cell_m.to_bits() == mapper.integrator.cell.metres().to_bits(), head.cell_m, "the edge of a cell that is set")?;
        require(head.l_max.to_bits() == mapper.integrator.l_max.to_bits(), head.l_max, "the limit of log-odds that is set")?;
        require(head.unfiltered == mapper.unfiltered.is_some(), head.unfiltered, "an unfiltered layer as it is set")?;
        require(head.localised.is_some() == mapper.localised.is_some(), head.localised.is_some(), "poses by estimates as it is set")?;
        (mapper.last, mapper.counts) = (head.last, head.counts);
        mapper.path = head.path.restore()?;
        for SavedScan { at: StreamCursor { seq, stamp_ns }, scan, decision, map_from_robot, is_placed, is_smoothed } in head.pending {
            let after = mapper.pending.back().map_or((0, 0), |before| (before.seq, before.stamp_ns));
            require(seq > after.0 && seq <= mapper.last.seq, seq, "pending scans in their order, up to the last one taken")?;
            require((after.1..=mapper.last.stamp_ns).contains(&stamp_ns), stamp_ns, "times in their order")?;
            let decision = decision.map(Decision::try_from).transpose()?;
            let map_from_robot = pose(map_from_robot)?;
            mapper.pending.push_back(PendingScan { seq, stamp_ns, scan, decision, outlook: 0, map_from_robot, is_placed, is_smoothed });
        }
        for (seq, decision) in head.early {
            let in_order = seq > mapper.early.last_key_value().map_or(mapper.last.seq, |(last, _)| *last);
            require(in_order && mapper.early.len() < MAX_EARLY, seq, "at most 1024 early verdicts in their order")?;
            mapper.early.insert(seq, decision.try_into()?);
        }
        for [layer, row, column] in &head.uncommitted {
            let key = TileKey { row: *row, column: *column };
            mapper.layer_numbered(*layer, key)?.restore_uncommitted(key);
        }
        mapper.localised = head.localised.map(|saved| saved.restore(mapper.deadline_ns(), mapper.last.seq)).transpose()?;
        let out_of_date: BTreeSet<[i32; 3]> = head.uncommitted.into_iter().collect();
        for (name, bytes) in parts.into_iter().filter(|(name, _)| !out_of_date.contains(name)) {
            mapper.take_part(name, bytes)?;
        }
        Ok(mapper)
    }

    fn take_part(&mut self, [layer, row, column]: [i32; 3], bytes: &[u8]) -> Result<(), StateError> {
        if let (CHUNKS, Some(localised)) = (layer, &mut self.localised) {
            return localised.committed.take_chunk(row, bytes);
        }
        let cells = decode_part::<Packed<'_, f32>>(bytes)?.into_vec();
        let l_max = self.integrator.l_max;
        if let Some(cell) = cells.iter().find(|cell| cell.is_nan() || cell.abs() > l_max) {
            return Err(error(format!("a cell of {cell}"), "a cell within the limit of log-odds"));
        }
        let cells: Tile<f32> =
            cells.try_into().map_err(|cells: Vec<f32>| error(format!("a tile of {} cells", cells.len()), "1024 cells"))?;
        let key = TileKey { row, column };
        self.layer_numbered(layer, key)?.restore_tile(key, &cells);
        Ok(())
    }

    /// The layer of a tile.
    fn layer_numbered(&mut self, layer: i32, key: TileKey) -> Result<&mut Layer, StateError> {
        let found = match (layer, &mut self.unfiltered) {
            (0, _) => Some(&mut self.filtered),
            (1, Some(unfiltered)) => Some(unfiltered),
            _ => None,
        };
        let found = found.filter(|_| key.first_cell().is_some());
        found.ok_or_else(|| error(format!("tile {layer} {} {}", key.row, key.column), "a tile of a layer that is set, within reach"))
    }

    fn deadline_ns(&self) -> Option<u64> {
        self.localised.as_ref().and_then(|localised| localised.deadline_ns)
    }

    fn layers(&self) -> impl Iterator<Item = &Layer> {
        std::iter::once(&self.filtered).chain(&self.unfiltered)
    }
}

const _: () = assert!(TILE_CELLS == 1024);

fn chunk_name(chunk: usize) -> [i32; 3] {
    [CHUNKS, chunk as i32, 0]
}

impl From<&Decision> for SavedDecision {
    fn from(decision: &Decision) -> Self {
        match decision {
            Decision::Withhold(readings) => Self::Withhold(*readings),
            Decision::Free(regions) => Self::Free(regions.iter().map(|it| [it.x_m, it.y_m, it.cells]).collect()),
        }
    }
}

impl TryFrom<SavedDecision> for Decision {
    type Error = StateError;

    fn try_from(saved: SavedDecision) -> Result<Self, StateError> {
        match saved {
            SavedDecision::Withhold(readings) => {
                require(readings <= ALL_READINGS, readings, "a bit for each of 16 readings")?;
                Ok(Self::Withhold(readings))
            }
            SavedDecision::Free(regions) => {
                require(regions.len() <= MAX_REGIONS, regions.len(), "at most 8 regions")?;
                let mut verdict =
                    FilterVerdict { count: regions.len() as u32, action: FilterAction::Free as u32, ..FilterVerdict::default() };
                for (region, [x_m, y_m, cells]) in verdict.regions.iter_mut().zip(regions) {
                    *region = UpdateRegion { x_m, y_m, cells };
                }
                verdict.validate().map_err(|invalid| error(invalid.to_string(), "a valid verdict"))?;
                Ok(Self::of(&verdict))
            }
        }
    }
}
