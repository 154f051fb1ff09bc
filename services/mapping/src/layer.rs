//! One of the two lattices: what is integrated for good, and what is shown.

use std::collections::BTreeSet;

use grid::{CellSize, Lattice, TILE_CELLS, Tile, TileKey};

use crate::Parameters;
use crate::pending::PendingScan;

const UNKNOWN: Tile<f32> = [0.0; TILE_CELLS];

/// A lattice of log-odds with the pending readings on top.
///
/// What is shown is the committed lattice with the pending readings integrated on top. Nothing is ever subtracted: the tiles
/// that pending readings touch are copied from the committed ones and the readings integrated anew.
#[derive(Debug, Clone)]
pub(crate) struct Layer {
    /// Whether verdicts count here.
    heeds_verdicts: bool,
    committed: Lattice<f32>,
    shown: Lattice<f32>,
    /// Tiles committed to since `shown` was made.
    settled: BTreeSet<TileKey>,
    /// Tiles of `shown` that have not been sent as they are.
    unsent: BTreeSet<TileKey>,
}

impl Layer {
    pub(crate) fn new(cell: CellSize, heeds_verdicts: bool) -> Self {
        Self { heeds_verdicts, committed: Lattice::new(cell), shown: Lattice::new(cell), settled: BTreeSet::new(), unsent: BTreeSet::new() }
    }

    /// What is integrated for good.
    pub(crate) fn committed(&self) -> &Lattice<f32> {
        &self.committed
    }

    /// What is shown since the last [`Self::refresh`].
    pub(crate) fn shown(&self) -> &Lattice<f32> {
        &self.shown
    }

    /// Takes a committed tile from elsewhere.
    pub(crate) fn restore_tile(&mut self, key: TileKey, cells: &Tile<f32>) {
        self.committed.set_tile(key, cells);
    }

    /// Integrates a scan for good.
    pub(crate) fn commit(&mut self, parameters: &Parameters, scan: &PendingScan) {
        integrate(&mut self.committed, parameters, scan, self.heeds_verdicts);
    }

    /// Makes what is shown anew where it may have changed.
    pub(crate) fn refresh<'a>(&mut self, parameters: &Parameters, pending: impl Iterator<Item = &'a PendingScan>) {
        let mut top = Lattice::new(self.committed.cell_size());
        for scan in pending {
            for key in scan.beams().flat_map(|beam| beam.tiles(parameters)) {
                if top.tile(key).is_none() {
                    top.set_tile(key, self.committed.tile(key).unwrap_or(&UNKNOWN));
                }
            }
            integrate(&mut top, parameters, scan, self.heeds_verdicts);
        }
        self.settled.extend(self.committed.take_changed());
        for key in std::mem::take(&mut self.settled) {
            if top.tile(key).is_none() {
                self.show(key, self.committed.tile(key).copied().unwrap_or(UNKNOWN));
            }
        }
        // Pending readings may be committed or withheld before the next time: their tiles are looked at again then.
        for (key, cells) in top.tiles() {
            self.show(key, *cells);
            self.settled.insert(key);
        }
    }

    #[expect(clippy::float_cmp, reason = "a tile that is the same to the bit is not sent again")]
    fn show(&mut self, key: TileKey, cells: Tile<f32>) {
        if *self.shown.tile(key).unwrap_or(&UNKNOWN) != cells {
            self.shown.set_tile(key, &cells);
            self.unsent.insert(key);
        }
    }

    /// Up to `most` tiles that are to be sent; they count as sent.
    pub(crate) fn take_unsent(&mut self, most: usize) -> Vec<TileKey> {
        let taken: Vec<TileKey> = self.unsent.iter().take(most).copied().collect();
        for key in &taken {
            self.unsent.remove(key);
        }
        taken
    }

    /// Every tile is to be sent again.
    pub(crate) fn send_again(&mut self) {
        self.unsent.extend(self.shown.tiles().map(|(key, _)| key));
    }
}

fn integrate(lattice: &mut Lattice<f32>, parameters: &Parameters, scan: &PendingScan, heeds_verdicts: bool) {
    for (index, beam) in scan.beams().enumerate() {
        beam.integrate(lattice, parameters, heeds_verdicts && scan.withholds(index));
    }
}
