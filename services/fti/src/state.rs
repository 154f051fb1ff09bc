//! The whole state as bytes, so that a restarted process goes on where it stopped.

use std::collections::VecDeque;

use grid::{Lattice, TILE_CELLS, Tile, TileKey};
use messages::Pose;
use serde::{Deserialize, Serialize, Serializer};

use crate::dwell::Runs;
use crate::pending::PendingScan;
use crate::still::{Evidence, Still};
use crate::streams::Streams;
use crate::tracks::Tracks;
use crate::{Fti, Parameters, ParametersError};

/// Changes whenever the bytes mean something else.
const VERSION: u32 = 4;

/// Bytes that are no state of this version.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum StateError {
    /// Written by another version.
    #[error("the state has version {found}, expected {VERSION}")]
    Version {
        /// Its version.
        found: u32,
    },
    /// Cut off, or not a state at all.
    #[error("the state cannot be read: {0}")]
    Damaged(#[from] postcard::Error),
    /// A tile with too few or too many cells.
    #[error("a tile of the state has {found} cells, expected {TILE_CELLS}")]
    Tile {
        /// Its cells.
        found: usize,
    },
    /// A scan that no verdict can be given on.
    #[error("scan {seq} of the state has more readings than a scan, or regions or inputs that there are not")]
    Scan {
        /// Its number.
        seq: u64,
    },
    /// The parameters it is to go on with.
    #[error(transparent)]
    Parameters(#[from] ParametersError),
}

/// Hits, sights of emptiness and the slots of the last of each.
type Packed = (u8, u8, u16, u16);

/// Written field by field, see [`Fti::write_to`].
#[derive(Deserialize)]
struct State {
    streams: Streams,
    tracks: Tracks,
    /// Row, column and cells of each tile.
    still: Vec<(i32, i32, Vec<Packed>)>,
    runs: Runs,
    company_ns: Option<u64>,
    pending: VecDeque<PendingScan>,
    recent: VecDeque<PendingScan>,
    /// Time, x, y and yaw.
    last: Option<(u64, f64, f64, f64)>,
}

/// The tiles as they are written: a copy of them all would take as much memory again.
struct Tiles<'a>(&'a Still);

impl Serialize for Tiles<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_seq(self.0.cells().tiles().map(|(key, cells)| (key.row, key.column, Cells(cells))))
    }
}

struct Cells<'a>(&'a Tile<Evidence>);

impl Serialize for Cells<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_seq(self.0.iter().map(|e| -> Packed { (e.hits, e.free, e.hit_slot, e.free_slot) }))
    }
}

impl Fti {
    /// The whole state.
    #[must_use]
    pub fn to_bytes(&self) -> Vec<u8> {
        self.write_to(Vec::new())
    }

    /// The bytes with the whole state behind them.
    #[must_use]
    pub fn write_to(&self, bytes: Vec<u8>) -> Vec<u8> {
        let last = self.last.map(|(stamp_ns, pose)| (stamp_ns, pose.x_m, pose.y_m, pose.yaw_rad));
        let state = (&self.streams, &self.tracks, Tiles(&self.still), &self.runs, self.company_ns, &self.pending, &self.recent, last);
        // Writing numbers and lists into memory has no way to fail.
        postcard::to_extend(&(VERSION, state), bytes).unwrap_or_default()
    }

    /// A service that goes on from a state.
    ///
    /// # Errors
    /// Bytes of another version or damaged ones; parameters that cannot be meant.
    pub fn from_bytes(parameters: Parameters, bytes: &[u8]) -> Result<Self, StateError> {
        let (found, rest) = postcard::take_from_bytes::<u32>(bytes)?;
        if found != VERSION {
            return Err(StateError::Version { found });
        }
        let state: State = postcard::from_bytes(rest)?;
        if let Some(scan) = state.pending.iter().chain(&state.recent).find(|scan| !scan.is_possible()) {
            return Err(StateError::Scan { seq: scan.seq });
        }
        let mut fti = Self::new(parameters)?;
        let mut cells = Lattice::new(fti.cell);
        for (row, column, packed) in state.still {
            let unpack = |(hits, free, hit_slot, free_slot)| Evidence { hits, free, hit_slot, free_slot };
            let tile: Vec<Evidence> = packed.into_iter().map(unpack).collect();
            let tile = tile.try_into().map_err(|tile: Vec<Evidence>| StateError::Tile { found: tile.len() })?;
            cells.set_tile(TileKey { row, column }, &tile);
        }
        fti.streams = state.streams;
        fti.tracks = state.tracks;
        fti.still = Still::new(cells);
        fti.runs = state.runs;
        fti.company_ns = state.company_ns;
        fti.pending = state.pending;
        fti.recent = state.recent;
        fti.last = state.last.map(|(stamp_ns, x_m, y_m, yaw_rad)| (stamp_ns, Pose { x_m, y_m, yaw_rad }));
        Ok(fti)
    }
}
