//! The state as bytes, so that a restarted process resumes where it stopped: a head, and tiles of evidence, of which few change
//! from one time to the next.

use std::borrow::Cow;

use geometry::{Lattice, TILE_CELLS, Tile, TileKey};
use messages::Pose;
use postcard_schema::Schema;
use serde::{Deserialize, Serialize, Serializer};
use state::{DecodeError, InParts, Queue, decode, decode_part, encode, encode_part};

use crate::dwell::Runs;
use crate::evidence::Evidence;
use crate::parameters::{Parameters, ParametersError};
use crate::pending::PendingScan;
use crate::pipeline::Fti;
use crate::still::{CellEvidence, Still};
use crate::streams::Streams;
use crate::tracks::Tracks;

/// Bytes that are no state of this version.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum StateError {
    /// They are of another version or damaged.
    #[error(transparent)]
    Bytes(#[from] DecodeError),
    /// A tile with too few or too many cells, or in a place that there is not.
    #[error("tile {key:?} of the state has {found} cells, expected one of layer 0 within reach with {TILE_CELLS}")]
    Tile {
        /// Layer, row and column.
        key: [i32; 3],
        /// Its cells.
        found: usize,
    },
    /// A scan that no verdict can be given on.
    #[error("scan {seq} of the state has more readings than a scan, or regions or inputs that there are not")]
    Scan {
        /// Its number.
        seq: u64,
    },
    /// The parameters it is restored with.
    #[error(transparent)]
    Parameters(#[from] ParametersError),
}

/// Hits, sights of emptiness and the slots of the last of each.
type Packed = (u8, u8, u16, u16);

#[derive(Serialize, Deserialize, Schema)]
struct Head<'a> {
    streams: Cow<'a, Streams>,
    tracks: Cow<'a, Tracks>,
    runs: Cow<'a, Runs>,
    last_confirmed_track_ns: Option<u64>,
    pending: Cow<'a, Queue<PendingScan>>,
    recent: Cow<'a, Queue<PendingScan>>,
    /// Time, x, y and yaw.
    last: Option<(u64, f64, f64, f64)>,
    tiles: InParts<Vec<Packed>>,
}

/// A tile as it is written: a copy would take as much memory again.
struct Cells<'a>(&'a Tile<CellEvidence>);

impl Serialize for Cells<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_seq(self.0.iter().map(|e| -> Packed { (e.hits, e.free, e.hit_slot, e.free_slot) }))
    }
}

impl Fti {
    /// The bytes with the state behind them, without its tiles.
    #[must_use]
    pub fn save_head(&self, bytes: Vec<u8>) -> Vec<u8> {
        let last = self.last.map(|(stamp_ns, pose)| (stamp_ns, pose.x_m, pose.y_m, pose.yaw_rad));
        let Evidence { runs, last_confirmed_track_ns, pending, recent, .. } = &self.evidence;
        let head = Head {
            streams: Cow::Borrowed(&self.streams),
            tracks: Cow::Borrowed(&self.tracks),
            runs: Cow::Borrowed(runs),
            last_confirmed_track_ns: *last_confirmed_track_ns,
            pending: Cow::Borrowed(pending),
            recent: Cow::Borrowed(recent),
            last,
            tiles: InParts::default(),
        };
        encode(&head, bytes)
    }

    /// Layer, row and column of each tile of the state; there is one layer, 0.
    #[must_use]
    pub fn saved_tiles(&self) -> Vec<[i32; 3]> {
        self.evidence.still.cells().tiles().map(|(key, _)| [0, key.row, key.column]).collect()
    }

    /// Layer, row and column of each tile that has changed since this was last asked.
    pub fn take_unsaved(&mut self) -> Vec<[i32; 3]> {
        self.evidence.still.take_changed().into_iter().map(|key| [0, key.row, key.column]).collect()
    }

    /// Appends a tile of the state to `bytes`; nothing where there is none.
    pub fn save_tile(&self, [_, row, column]: [i32; 3], bytes: &mut Vec<u8>) {
        if let Some(cells) = self.evidence.still.cells().tile(TileKey { row, column }) {
            *bytes = encode_part(&Cells(cells), std::mem::take(bytes));
        }
    }

    /// A service that resumes from what [`Self::save_head`] gave, and [`Self::save_tile`] of each tile.
    ///
    /// # Errors
    /// Bytes of another version or damaged ones; parameters out of range.
    pub fn restore<'a>(
        parameters: Parameters,
        head: &[u8],
        tiles: impl IntoIterator<Item = ([i32; 3], &'a [u8])>,
    ) -> Result<Self, StateError> {
        let head: Head<'_> = decode(head)?;
        if let Some(scan) = head.pending.iter().chain(head.recent.iter()).find(|scan| !scan.is_possible()) {
            return Err(StateError::Scan { seq: scan.seq });
        }
        let mut fti = Self::new(parameters)?;
        let mut cells = Lattice::new(fti.cell);
        for (key, packed) in tiles {
            let [layer, row, column] = key;
            let unpack = |(hits, free, hit_slot, free_slot)| CellEvidence { hits, free, hit_slot, free_slot };
            let tile: Vec<CellEvidence> = decode_part::<Vec<Packed>>(packed)?.into_iter().map(unpack).collect();
            let (place, found) = (TileKey { row, column }, tile.len());
            match tile.try_into() {
                Ok(tile) if layer == 0 && place.first_cell().is_some() => cells.set_tile(place, &tile),
                _ => return Err(StateError::Tile { key, found }),
            }
        }
        fti.streams = head.streams.into_owned();
        fti.tracks = head.tracks.into_owned();
        fti.evidence = Evidence {
            still: Still::new(cells),
            runs: head.runs.into_owned(),
            last_confirmed_track_ns: head.last_confirmed_track_ns,
            pending: head.pending.into_owned(),
            recent: head.recent.into_owned(),
        };
        fti.last = head.last.map(|(stamp_ns, x_m, y_m, yaw_rad)| (stamp_ns, Pose { x_m, y_m, yaw_rad }));
        Ok(fti)
    }
}
