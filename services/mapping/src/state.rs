//! The state of a mapper as bytes, so that another process can resume from it: a head, and the committed tiles, of which few change
//! from one time to the next. A tile is named by its layer (0 filtered, 1 unfiltered), row and column.

use geometry::{Lattice, TILE_CELLS, Tile, TileKey};
use messages::{FilterAction, FilterVerdict, MAX_READINGS, MAX_REGIONS, Payload, SonarScan, StreamCursor, UpdateRegion};
use postcard_schema::Schema;
use serde::{Deserialize, Serialize};
use state::{DecodeError, InParts, Packed, decode, decode_part, encode, encode_part};

use crate::layer::Layer;
use crate::mapper::{Counts, MAX_EARLY, Mapper};
use crate::pending::{Decision, PendingScan};
use crate::robot_path::{MAX_LENGTH_M, MAX_PLACES, RobotPath};

const ALL_READINGS: u32 = (1 << MAX_READINGS) - 1;

/// Bytes that are no state of a mapper with these parameters.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum StateError {
    /// They are of another version or damaged.
    #[error(transparent)]
    Bytes(#[from] DecodeError),
    /// A value that no mapper with these parameters has.
    #[error("{found}, expected {expected}")]
    Value {
        /// What is there.
        found: String,
        /// What should be.
        expected: &'static str,
    },
}

#[derive(Serialize, Deserialize, Schema)]
struct Head<'a> {
    /// Edge of a cell, m.
    cell_m: f64,
    /// Limit of the log-odds.
    l_max: f32,
    unfiltered: bool,
    last: StreamCursor,
    counts: Counts,
    way_step_m: f64,
    way_length_m: f64,
    way_m: Packed<'a, [f32; 2]>,
    pending: Vec<SavedScan>,
    early: Vec<(u64, SavedDecision)>,
    tiles: InParts<Packed<'a, f32>>,
}

#[derive(Serialize, Deserialize, Schema)]
struct SavedScan {
    at: StreamCursor,
    #[serde(with = "messages::payload_bytes")]
    scan: SonarScan,
    decision: Option<SavedDecision>,
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
        });
        let head = Head {
            cell_m: self.integrator.cell.metres(),
            l_max: self.integrator.l_max,
            unfiltered: self.unfiltered.is_some(),
            last: self.last,
            counts: self.counts,
            way_step_m: self.path.step_m,
            way_length_m: self.path.length_m,
            way_m: Packed::from(&self.path.places_m[..]),
            pending: pending.collect(),
            early: self.early.iter().map(|(seq, decision)| (*seq, decision.into())).collect(),
            tiles: InParts::default(),
        };
        encode(&head, Vec::new())
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
        if let Some(cells) = layer.and_then(|layer| layer.committed().tile(TileKey { row, column })) {
            *bytes = encode_part(&Packed::from(&cells[..]), std::mem::take(bytes));
        }
    }

    /// This empty mapper with the state that [`Self::save_head`] gave, and [`Self::save_tile`] of each tile, under the same
    /// parameters.
    ///
    /// # Errors
    /// Bytes that no mapper with these parameters saved.
    pub fn restore<'a>(self, head: &[u8], tiles: impl IntoIterator<Item = ([i32; 3], &'a [u8])>) -> Result<Self, StateError> {
        let head: Head<'_> = decode(head)?;
        let mut mapper = self;
        require(head.cell_m.to_bits() == mapper.integrator.cell.metres().to_bits(), head.cell_m, "the edge of a cell that is set")?;
        require(head.l_max.to_bits() == mapper.integrator.l_max.to_bits(), head.l_max, "the limit of log-odds that is set")?;
        require(head.unfiltered == mapper.unfiltered.is_some(), head.unfiltered, "an unfiltered layer as it is set")?;
        (mapper.last, mapper.counts) = (head.last, head.counts);
        mapper.path = path(head.way_step_m, head.way_length_m, head.way_m.into_vec())?;
        for SavedScan { at: StreamCursor { seq, stamp_ns }, scan, decision } in head.pending {
            let after = mapper.pending.back().map_or((0, 0), |before| (before.seq, before.stamp_ns));
            require(seq > after.0 && seq <= mapper.last.seq, seq, "pending scans in their order, up to the last one taken")?;
            require((after.1..=mapper.last.stamp_ns).contains(&stamp_ns), stamp_ns, "times in their order")?;
            let decision = decision.map(Decision::try_from).transpose()?;
            mapper.pending.push_back(PendingScan { seq, stamp_ns, scan, decision, outlook: 0 });
        }
        for (seq, decision) in head.early {
            let in_order = seq > mapper.early.last_key_value().map_or(mapper.last.seq, |(last, _)| *last);
            require(in_order && mapper.early.len() < MAX_EARLY, seq, "at most 1024 early verdicts in their order")?;
            mapper.early.insert(seq, decision.try_into()?);
        }
        tiles.into_iter().try_for_each(|(key, bytes)| mapper.take_tile(key, bytes))?;
        Ok(mapper)
    }

    fn take_tile(&mut self, key: [i32; 3], bytes: &[u8]) -> Result<(), StateError> {
        let cells = decode_part::<Packed<'_, f32>>(bytes)?.into_vec();
        let l_max = self.integrator.l_max;
        if let Some(cell) = cells.iter().find(|cell| cell.is_nan() || cell.abs() > l_max) {
            return Err(error(format!("a cell of {cell}"), "a cell within the limit of log-odds"));
        }
        let cells: Tile<f32> =
            cells.try_into().map_err(|cells: Vec<f32>| error(format!("a tile of {} cells", cells.len()), "1024 cells"))?;
        let [layer, row, column] = key;
        let place = TileKey { row, column };
        let layer = match (layer, &mut self.unfiltered) {
            (0, _) => Some(&mut self.filtered),
            (1, Some(unfiltered)) => Some(unfiltered),
            _ => None,
        };
        let Some(layer) = layer.filter(|_| place.first_cell().is_some()) else {
            return Err(error(format!("tile {key:?}"), "a tile of a layer that is set, within reach"));
        };
        layer.restore_tile(place, &cells);
        Ok(())
    }

    fn layers(&self) -> impl Iterator<Item = &Layer> {
        std::iter::once(&self.filtered).chain(&self.unfiltered)
    }
}

const _: () = assert!(TILE_CELLS == 1024);

fn path(step_m: f64, length_m: f64, places_m: Vec<[f32; 2]>) -> Result<RobotPath, StateError> {
    require(step_m > 0.0 && step_m.is_finite(), step_m, "a step of the path above 0")?;
    require((0.0..=MAX_LENGTH_M).contains(&length_m), length_m, "a length of the path")?;
    require(places_m.len() <= MAX_PLACES, places_m.len(), "at most 16384 points of the path")?;
    let far = places_m.iter().find(|place| !place.iter().all(|number| number.abs() <= 1e6));
    far.map_or(Ok(()), |place| Err(error(format!("{place:?}"), "a point within 1000 km")))?;
    Ok(RobotPath::restored(step_m, length_m, places_m))
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

fn require(holds: bool, found: impl std::fmt::Display, expected: &'static str) -> Result<(), StateError> {
    if holds { Ok(()) } else { Err(error(found.to_string(), expected)) }
}

fn error(found: String, expected: &'static str) -> StateError {
    StateError::Value { found, expected }
}
