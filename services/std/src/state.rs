//! The whole state as bytes, so that a restarted process goes on where it stopped.

use std::collections::VecDeque;

use geometry::{Cell, Lattice, TILE_CELLS, TileKey};
use serde::{Deserialize, Serialize};

use crate::parameters::{Parameters, ParametersError};
use crate::seen_free::SeenFree;
use crate::step::Std;
use crate::tracks::Tracks;
use crate::tvm::TimeVariantMap;

/// Changes whenever the bytes mean something else.
const VERSION: u32 = 1;

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
    /// A tile with too few or too many cells, or in a place that there is not.
    #[error("a tile of the state has {found} cells, expected {TILE_CELLS}")]
    Tile {
        /// Its cells.
        found: usize,
    },
    /// The parameters it is to go on with.
    #[error(transparent)]
    Parameters(#[from] ParametersError),
}

#[derive(Serialize, Deserialize)]
struct State {
    scan: u32,
    /// Row and column of each tagged cell, for each scan of the span.
    tags: VecDeque<Vec<(i32, i32)>>,
    /// Row, column and cells of each tile.
    seen_free: Vec<(i32, i32, Vec<u32>)>,
    tracks: Tracks,
}

impl Std {
    /// The whole state.
    #[must_use]
    pub fn to_bytes(&self) -> Vec<u8> {
        let tags = self.tvm.scans().iter().map(|cells| cells.iter().map(|cell| (cell.row, cell.column)).collect()).collect();
        let seen_free = self.seen_free.scans().tiles().map(|(key, cells)| (key.row, key.column, cells.to_vec())).collect();
        let state = State { scan: self.scan, tags, seen_free, tracks: self.tracks.clone() };
        // Writing numbers and lists into memory has no way to fail.
        postcard::to_allocvec(&(VERSION, state)).unwrap_or_default()
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
        let mut std = Self::new(parameters)?;
        let mut seen = Lattice::new(std.cell);
        for (row, column, cells) in state.seen_free {
            let cells = cells.try_into().map_err(|cells: Vec<u32>| StateError::Tile { found: cells.len() })?;
            seen.set_tile(TileKey { row, column }, &cells);
        }
        let tags = state.tags.into_iter().map(|cells| cells.into_iter().map(|(row, column)| Cell { row, column }).collect());
        std.scan = state.scan;
        std.tvm = TimeVariantMap::from_scans(tags.collect());
        std.seen_free = SeenFree::new(seen);
        std.tracks = state.tracks;
        Ok(std)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use messages::{Pose, SonarMotion, SonarReading, SonarScan};
    use proptest::prelude::*;

    fn go_on(std: &mut Std, ranges_m: &[f64], from: u64) -> Vec<SonarMotion> {
        let scan = |range_m| SonarScan::new(Pose::default(), &[SonarReading { range_m, echo: 1, ..SonarReading::default() }], false);
        (from..).zip(ranges_m).map(|(k, &range_m)| std.step(k * 100_000_000, &scan(range_m))).collect()
    }

    proptest! {
        #[test]
        fn a_state_read_back_goes_on_the_same(ranges in proptest::collection::vec(0.3..2.9f64, 20), cut in 0..20usize) {
            let mut whole = Std::new(Parameters::default()).unwrap();
            go_on(&mut whole, &ranges[..cut], 0);
            let mut restored = Std::from_bytes(Parameters::default(), &whole.to_bytes()).unwrap();
            prop_assert_eq!(go_on(&mut restored, &ranges[cut..], cut as u64), go_on(&mut whole, &ranges[cut..], cut as u64));
            prop_assert_eq!(restored.to_bytes(), whole.to_bytes());
        }

        #[test]
        fn garbage_is_refused_or_read_but_never_breaks(bytes in proptest::collection::vec(any::<u8>(), 0..200)) {
            let mut versioned = vec![VERSION as u8];
            versioned.extend(&bytes);
            if let Ok(mut std) = Std::from_bytes(Parameters::default(), &versioned) {
                go_on(&mut std, &[1.0, 2.0, 1.0], 0);
            }
        }
    }

    #[test]
    fn another_version_and_cut_bytes_are_refused() {
        let error = |bytes: &[u8]| Std::from_bytes(Parameters::default(), bytes).unwrap_err();
        assert_eq!(error(&[9, 0]), StateError::Version { found: 9 });
        let bytes = Std::new(Parameters::default()).unwrap().to_bytes();
        assert!(matches!(error(&bytes[..bytes.len() - 1]), StateError::Damaged(_)));
    }
}
