//! Which tiles were looked up last.

use crate::TileKey;

/// A block of 4 × 4 tiles, more than a beam covers, has a place for each of its tiles.
const BLOCK_EDGE: i32 = 4;

/// The place in memory of the tile last looked up in each place of a 4 × 4 pattern: neighbours never displace each other.
#[derive(Debug, Clone, Default)]
pub(crate) struct Recent {
    entries: [Option<(TileKey, usize)>; (BLOCK_EDGE * BLOCK_EDGE) as usize],
}

impl Recent {
    pub(crate) fn get(&self, key: TileKey) -> Option<usize> {
        match self.entries[place(key)] {
            Some((held, slot)) if held == key => Some(slot),
            _ => None,
        }
    }

    pub(crate) fn put(&mut self, key: TileKey, slot: usize) {
        self.entries[place(key)] = Some((key, slot));
    }
}

fn place(key: TileKey) -> usize {
    let (row, column) = (key.row & (BLOCK_EDGE - 1), key.column & (BLOCK_EDGE - 1));
    (row * BLOCK_EDGE + column) as usize
}
