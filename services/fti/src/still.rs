//! Whether something stands there: in how many slots of time a cell was hit, and in how many it was seen free.

use geometry::Beam;
use geometry::{Cell, CellSize, Lattice, TILE_CELLS, TileKey};

/// Readings of one slot count once: a firing cycle and a half, ns.
/// Half: 84.4 % / 1.26 %, twice: 85.6 % / 1.51 %.
pub(crate) const SLOT_NS: u64 = 400_000_000;
/// More hits say no more.
/// Half: 85.2 % / 2.28 %, twice: 84.8 % / 1.34 %.
const MOST_HITS: f64 = 4.5;
/// More sights of emptiness say no more.
/// Half: 84.6 % / 1.24 %, twice: 85.0 % / 1.36 %.
const MOST_FREE: f64 = 6.0;
/// Most slots of each kind that the past keeps.
const MOST_COUNTS: [u8; 2] = [3, 6];
/// A beam shows cells free this close to its axis only, rad: later it is not known from where it looked.
/// Half: 84.1 % / 1.24 %, twice: 85.0 % / 1.46 %.
const FREE_HALF_RAD: f64 = 0.105;
/// What lies this close before an echo may belong to it, m.
/// Half: 85.0 % / 1.39 %, twice: 84.7 % / 1.24 %.
const BEFORE_ECHO_M: f64 = 0.12;
/// Farther away a beam is too wide for its silence to tell of a cell, m.
/// Half: 80.8 % / 0.89 %, twice: 86.2 % / 2.71 %.
pub(crate) const REACH_M: f64 = 2.2;

/// What the past says of a cell.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(crate) struct CellEvidence {
    /// Slots in which it was hit, at most 3.
    pub(crate) hits: u8,
    /// Slots in which it was seen free, at most 6.
    pub(crate) free: u8,
    /// Low bits of the slots after the last hit and the last sight of emptiness; 0: never.
    pub(crate) hit_slot: u16,
    pub(crate) free_slot: u16,
}

/// The balance of a cell by the slots in which it was hit and seen free: positive where something stands.
pub(crate) fn balance(hits: f64, free: f64) -> f64 {
    hits.min(MOST_HITS) - free.min(MOST_FREE)
}

/// The past of every cell. Grows with the area explored.
#[derive(Debug, Clone)]
pub(crate) struct Still {
    cells: Lattice<CellEvidence>,
}

impl Still {
    pub(crate) fn new(cells: Lattice<CellEvidence>) -> Self {
        Self { cells }
    }

    pub(crate) fn cells(&self) -> &Lattice<CellEvidence> {
        &self.cells
    }

    /// The tiles that have changed since this was last asked.
    pub(crate) fn take_changed(&mut self) -> Vec<TileKey> {
        self.cells.take_changed()
    }

    /// Forgets every cell. The tiles stay: a checkpoint to which changes are appended would otherwise hold their old cells.
    pub(crate) fn forget(&mut self) {
        let keys: Vec<TileKey> = self.cells.tiles().map(|(key, _)| key).collect();
        for key in keys {
            self.cells.set_tile(key, &[CellEvidence::default(); TILE_CELLS]);
        }
    }

    pub(crate) fn size(&self) -> CellSize {
        self.cells.cell_size()
    }

    pub(crate) fn get(&self, cell: Cell) -> CellEvidence {
        self.cells.get(cell)
    }

    /// An echo came from these cells.
    pub(crate) fn hit(&mut self, cells: &[Cell], stamp_ns: u64) {
        let slot = slot_mark(stamp_ns);
        for cell in cells {
            let mut evidence = self.cells.get(*cell);
            if evidence.hit_slot != slot {
                evidence.hits = evidence.hits.saturating_add(1).min(MOST_COUNTS[0]);
                evidence.hit_slot = slot;
                self.cells.set(*cell, evidence);
            }
        }
    }

    /// An echo was the first thing in its beam.
    pub(crate) fn free(&mut self, beam: &Beam, stamp_ns: u64) {
        let size = self.size();
        if let Some(reach_m) = free_reach_m(beam) {
            let cells = &mut self.cells;
            beam.visit_cone(size, FREE_HALF_RAD, reach_m, |cell| add_free(cells, cell, slot_mark(stamp_ns)));
        }
    }

    /// The robot stands on the cells within `radius_m` of a place.
    pub(crate) fn stand(&mut self, x_m: f64, y_m: f64, radius_m: f64, stamp_ns: u64) {
        let size = self.size();
        for row in size.index_of(y_m - radius_m)..=size.index_of(y_m + radius_m) {
            for column in size.index_of(x_m - radius_m)..=size.index_of(x_m + radius_m) {
                if (size.centre_of(column) - x_m).hypot(size.centre_of(row) - y_m) <= radius_m {
                    add_free(&mut self.cells, Cell { row, column }, slot_mark(stamp_ns));
                }
            }
        }
    }
}

/// How far the beam shows its cells free, m; `None`: a wall may be a mirror, so that silence tells nothing.
pub(crate) fn free_reach_m(beam: &Beam) -> Option<f64> {
    beam.echo().then(|| (beam.range_m() - BEFORE_ECHO_M).min(REACH_M))
}

fn add_free(cells: &mut Lattice<CellEvidence>, cell: Cell, slot: u16) {
    let mut evidence = cells.get(cell);
    if evidence.free_slot != slot {
        evidence.free = evidence.free.saturating_add(1).min(MOST_COUNTS[1]);
        evidence.free_slot = slot;
        cells.set(cell, evidence);
    }
}

/// A slot's mark: never 0. It comes again after seven hours; a cell last hit then is not counted once.
fn slot_mark(stamp_ns: u64) -> u16 {
    (stamp_ns / SLOT_NS % u64::from(u16::MAX)) as u16 + 1
}

#[cfg(test)]
mod tests {
    use super::*;
    use messages::{Pose, SonarReading};

    fn still() -> Still {
        Still::new(Lattice::new(CellSize::new(0.05).unwrap()))
    }

    /// The greatest balance of these cells.
    fn past(still: &Still, cells: &[Cell]) -> f64 {
        let balances = cells.iter().map(|cell| still.get(*cell)).map(|e| balance(f64::from(e.hits), f64::from(e.free)));
        balances.fold(f64::NEG_INFINITY, f64::max)
    }

    fn beam(range_m: f64, echo: u32) -> Beam {
        Beam::new(&Pose::default(), &SonarReading { range_m, echo, ..SonarReading::default() }, 0.218)
    }

    #[test]
    fn hits_of_one_slot_count_once_and_three_are_enough() {
        let mut still = still();
        let arc = beam(1.0, 1).arc(still.size(), 0.05);
        for stamp_ns in [0, SLOT_NS / 2, SLOT_NS, 2 * SLOT_NS, 3 * SLOT_NS] {
            still.hit(&arc, stamp_ns);
            if stamp_ns < SLOT_NS {
                assert_eq!(past(&still, &arc), 1.0);
            }
        }
        assert_eq!(past(&still, &arc), 3.0);
    }

    #[test]
    fn what_lies_before_an_echo_loses() {
        let mut still = still();
        still.free(&beam(2.0, 1), 0);
        assert_eq!(past(&still, &[Cell { row: 0, column: 20 }]), -1.0);
        assert_eq!(past(&still, &[Cell { row: 0, column: 38 }]), 0.0);
        still.free(&beam(3.0, 0), SLOT_NS);
        assert_eq!(past(&still, &[Cell { row: 0, column: 20 }]), -1.0);
    }

    #[test]
    fn a_cell_of_a_damaged_state_is_counted_on() {
        let (mut still, cell) = (still(), Cell { row: 0, column: 3 });
        still.cells.set(cell, CellEvidence { hits: u8::MAX, free: u8::MAX, hit_slot: 9, free_slot: 9 });
        still.hit(&[cell], 0);
        still.stand(0.0, 0.0, 0.2, 0);
        let CellEvidence { hits, free, .. } = still.get(cell);
        assert_eq!([hits, free], MOST_COUNTS);
    }

    #[test]
    fn nothing_stands_where_the_robot_stood() {
        let mut still = still();
        still.stand(0.0, 0.0, 0.2, 0);
        assert_eq!(past(&still, &[Cell { row: 0, column: 3 }]), -1.0);
        assert_eq!(past(&still, &[Cell { row: 3, column: 3 }]), 0.0);
    }
}
