//! One of the two lattices: what is integrated for good, and what is shown.

use std::collections::BTreeSet;

use geometry::{Cell, CellSize, Lattice, TILE_CELLS, Tile, TileKey};

use messages::UpdateRegion;

use crate::despeckle::tiles_that_see;
use crate::integrate::{Beam, Integrator};
use crate::pending::PendingScan;
use crate::placed::PlacedScan;

const UNKNOWN: Tile<f32> = [0.0; TILE_CELLS];

/// A lattice of log-odds with the pending readings on top.
///
/// What is shown is the committed lattice with the pending readings integrated on top. Nothing is ever subtracted: the tiles
/// that pending readings touch are copied from the committed ones and the readings integrated anew.
#[derive(Debug, Clone)]
pub(crate) struct Layer {
    /// Whether verdicts count here.
    heeds_verdicts: bool,
    /// Occupied cells with fewer occupied neighbours are published as free.
    lonely_below: usize,
    committed: Lattice<f32>,
    shown: Lattice<f32>,
    /// Tiles committed to since `shown` was made.
    settled: BTreeSet<TileKey>,
    /// Tiles committed to since they were last saved.
    unsaved: BTreeSet<TileKey>,
    /// Tiles of `shown` that have not been sent as they are.
    unsent: BTreeSet<TileKey>,
    /// Tiles that a viewer or a checkpoint may hold and that are not committed: pending readings lie there, or did, or a map before
    /// held them. Committed ones among them count no more.
    uncommitted: BTreeSet<TileKey>,
}

impl Layer {
    pub(crate) fn new(cell: CellSize, heeds_verdicts: bool, lonely_below: usize) -> Self {
        Self {
            heeds_verdicts,
            lonely_below,
            committed: Lattice::new(cell),
            shown: Lattice::new(cell),
            settled: BTreeSet::new(),
            unsaved: BTreeSet::new(),
            unsent: BTreeSet::new(),
            uncommitted: BTreeSet::new(),
        }
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
        self.restore_shown(key, cells);
    }

    /// Whether verdicts count here.
    pub(crate) fn heeds_verdicts(&self) -> bool {
        self.heeds_verdicts
    }

    /// Integrates a scan for good.
    pub(crate) fn commit(&mut self, integrator: &Integrator, scan: &PlacedScan<'_>) {
        draw(&mut self.committed, integrator, scan, self.heeds_verdicts);
    }

    /// Puts another lattice in the place of what is integrated for good.
    pub(crate) fn replace(&mut self, committed: Lattice<f32>) {
        self.note_commits();
        let before = std::mem::replace(&mut self.committed, committed);
        self.uncommitted.extend(before.tiles().map(|(key, _)| key));
        self.uncommitted.retain(|key| self.committed.tile(*key).is_none());
        self.unsaved.retain(|key| self.committed.tile(*key).is_some());
        self.settled.extend(&self.uncommitted);
    }

    /// Tiles that a viewer or a checkpoint may hold and that are not committed.
    pub(crate) fn uncommitted(&self) -> impl Iterator<Item = TileKey> {
        self.uncommitted.iter().copied().filter(|key| self.committed.tile(*key).is_none())
    }

    /// Takes from elsewhere that a viewer or a checkpoint may hold a tile that is not committed.
    pub(crate) fn restore_uncommitted(&mut self, key: TileKey) {
        self.uncommitted.insert(key);
        self.restore_shown(key, &UNKNOWN);
    }

    /// A viewer may hold anything of a tile: readings that were pending lie on it, or did.
    fn restore_shown(&mut self, key: TileKey, cells: &Tile<f32>) {
        self.shown.set_tile(key, cells);
        self.unsent.insert(key);
    }

    /// Makes what is shown anew where it may have changed.
    pub(crate) fn refresh<'a>(&mut self, integrator: &Integrator, pending: impl Iterator<Item = &'a PendingScan>) {
        let mut top = Lattice::new(self.committed.cell_size());
        for scan in pending.filter(|scan| scan.is_placed) {
            for key in scan.beams().flat_map(|beam| beam.tiles(integrator)) {
                if top.tile(key).is_none() {
                    top.set_tile(key, self.committed.tile(key).unwrap_or(&UNKNOWN));
                }
            }
            let withheld = if self.heeds_verdicts { scan.withheld_so_far() } else { 0 };
            integrate(&mut top, integrator, scan.beams(), withheld);
        }
        self.note_commits();
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

    fn note_commits(&mut self) {
        let committed = self.committed.take_changed();
        self.unsaved.extend(&committed);
        self.settled.extend(committed);
    }

    /// The tiles committed to since this was last asked; they count as saved.
    pub(crate) fn take_unsaved(&mut self) -> BTreeSet<TileKey> {
        self.note_commits();
        std::mem::take(&mut self.unsaved)
    }

    #[expect(clippy::float_cmp, reason = "a tile that is the same to the bit is not sent again")]
    fn show(&mut self, key: TileKey, cells: Tile<f32>) {
        if *self.shown.tile(key).unwrap_or(&UNKNOWN) != cells {
            self.shown.set_tile(key, &cells);
            if self.committed.tile(key).is_none() {
                self.uncommitted.insert(key);
            }
            self.unsent.extend(tiles_that_see(key, self.lonely_below));
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

/// Integrates a decided scan.
pub(crate) fn draw(lattice: &mut Lattice<f32>, integrator: &Integrator, scan: &PlacedScan<'_>, heeds_verdicts: bool) {
    integrate(lattice, integrator, scan.beams(), if heeds_verdicts { scan.withheld } else { 0 });
    if heeds_verdicts {
        scan.freed.iter().for_each(|region| set_free(lattice, region, -integrator.l_max));
    }
}

/// Bit i of `withheld` set: reading i leaves its occupied part out.
fn integrate<'a>(lattice: &mut Lattice<f32>, integrator: &Integrator, beams: impl Iterator<Item = Beam<'a>>, withheld: u32) {
    for (index, beam) in beams.enumerate() {
        beam.integrate(lattice, integrator, withheld & (1 << index) != 0);
    }
}

/// Gives the cells of a region, a disc of as many cells as its size says, these log-odds: what is known of them before is
/// wrong. Cells nothing is known of stay so.
fn set_free(lattice: &mut Lattice<f32>, region: &UpdateRegion, log_odds: f32) {
    let cell = lattice.cell_size();
    let radius_m = (region.cells.max(0.0) / std::f64::consts::PI).sqrt() * cell.metres();
    let (from, to) =
        (cell.cell_at(region.x_m - radius_m, region.y_m - radius_m), cell.cell_at(region.x_m + radius_m, region.y_m + radius_m));
    for row in from.row..=to.row {
        for column in from.column..=to.column {
            let place = Cell { row, column };
            let away_m = (cell.centre_of(column) - region.x_m).hypot(cell.centre_of(row) - region.y_m);
            if away_m <= radius_m && lattice.get(place) != 0.0 {
                lattice.set(place, log_odds);
            }
        }
    }
}
