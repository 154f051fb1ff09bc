//! The whole state as bytes, so that a restarted process resumes where it stopped.

use std::borrow::Cow;

use geometry::{Cell, Lattice, TILE_CELLS, TileKey};
use postcard_schema::Schema;
use serde::{Deserialize, Serialize};
use state::{DecodeError, Packed, decode, encode};

use crate::parameters::{Parameters, ParametersError};
use crate::seen_free::SeenFree;
use crate::step::Std;
use crate::tracks::Tracks;
use crate::tvm::TimeVariantMap;

/// Bytes that are no state of this version.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum StateError {
    /// They are of another version or damaged.
    #[error(transparent)]
    Bytes(#[from] DecodeError),
    /// A tile with too few or too many cells, or in a place that there is not.
    #[error("a tile of the state has {found} cells, expected {TILE_CELLS}")]
    Tile {
        /// Its cells.
        found: usize,
    },
    /// The parameters it is restored with.
    #[error(transparent)]
    Parameters(#[from] ParametersError),
}

#[derive(Serialize, Deserialize, Schema)]
struct State<'a> {
    scan: u32,
    /// The tagged cells of each scan of the span.
    tags: Vec<Cow<'a, [Cell]>>,
    /// Row, column and cells of each tile.
    seen_free: Vec<(i32, i32, Packed<'a, u32>)>,
    tracks: Cow<'a, Tracks>,
}

impl Std {
    /// The whole state.
    #[must_use]
    pub fn to_bytes(&self) -> Vec<u8> {
        let tags = self.tvm.scans().iter().map(|cells| Cow::Borrowed(&cells[..])).collect();
        let seen_free = self.seen_free.scans().tiles().map(|(key, cells)| (key.row, key.column, Packed::from(&cells[..]))).collect();
        encode(&State { scan: self.scan, tags, seen_free, tracks: Cow::Borrowed(&self.tracks) }, Vec::new())
    }

    /// A service that resumes from a state.
    ///
    /// # Errors
    /// Bytes of another version or damaged ones; parameters out of range.
    pub fn from_bytes(parameters: Parameters, bytes: &[u8]) -> Result<Self, StateError> {
        let state: State<'_> = decode(bytes)?;
        let mut std = Self::new(parameters)?;
        let mut seen = Lattice::new(std.cell);
        for (row, column, cells) in state.seen_free {
            let cells = cells.into_vec().try_into().map_err(|cells: Vec<u32>| StateError::Tile { found: cells.len() })?;
            seen.set_tile(TileKey { row, column }, &cells);
        }
        std.scan = state.scan;
        std.tvm = TimeVariantMap::from_scans(state.tags.into_iter().map(Cow::into_owned).collect());
        std.seen_free = SeenFree::new(seen);
        std.tracks = state.tracks.into_owned();
        Ok(std)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use messages::{Pose, SonarMotion, SonarReading, SonarScan};
    use proptest::prelude::*;

    fn step_all(std: &mut Std, ranges_m: &[f64], from: u64) -> Vec<SonarMotion> {
        let scan = |range_m| SonarScan::new(Pose::default(), &[SonarReading { range_m, echo: 1, ..SonarReading::default() }], false);
        (from..).zip(ranges_m).map(|(k, &range_m)| std.step(k * 100_000_000, &scan(range_m))).collect()
    }

    proptest! {
        #[test]
        fn a_restored_state_gives_the_same_answers(ranges in proptest::collection::vec(0.3..2.9f64, 20), cut in 0..20usize) {
            let mut whole = Std::new(Parameters::default()).unwrap();
            step_all(&mut whole, &ranges[..cut], 0);
            let mut restored = Std::from_bytes(Parameters::default(), &whole.to_bytes()).unwrap();
            prop_assert_eq!(step_all(&mut restored, &ranges[cut..], cut as u64), step_all(&mut whole, &ranges[cut..], cut as u64));
            prop_assert_eq!(restored.to_bytes(), whole.to_bytes());
        }

        #[test]
        fn garbage_is_refused_or_read_but_never_breaks(bytes in proptest::collection::vec(any::<u8>(), 0..200)) {
            let mut versioned = state::version::<State<'_>>().to_le_bytes().to_vec();
            versioned.extend(&bytes);
            if let Ok(mut std) = Std::from_bytes(Parameters::default(), &versioned) {
                step_all(&mut std, &[1.0, 2.0, 1.0], 0);
            }
        }
    }

    #[test]
    fn another_version_and_cut_bytes_are_refused() {
        let error = |bytes: &[u8]| Std::from_bytes(Parameters::default(), bytes).unwrap_err();
        let bytes = Std::new(Parameters::default()).unwrap().to_bytes();
        let mut other = bytes.clone();
        other[0] ^= 1;
        assert!(matches!(error(&other), StateError::Bytes(DecodeError::Version { .. })));
        assert!(matches!(error(&bytes[..bytes.len() - 1]), StateError::Bytes(DecodeError::Damaged(_))));
    }
}
