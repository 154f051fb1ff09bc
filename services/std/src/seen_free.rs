//! Which cells were seen free lately (rule *visible*).

use geometry::Beam;
use geometry::{Cell, Lattice, TileKey};

/// What lies this close before an echo may belong to it, m.
const BEFORE_ECHO_M: f64 = 0.15;

/// Farther away a beam is too wide for its silence to tell of a cell, m.
const REACH_M: f64 = 2.2;

/// For each cell the number of the scan that last saw it free; 0: none.
#[derive(Debug, Clone)]
pub(crate) struct SeenFree {
    scans: Lattice<u32>,
}

impl SeenFree {
    pub(crate) fn new(scans: Lattice<u32>) -> Self {
        Self { scans }
    }

    pub(crate) fn scans(&self) -> &Lattice<u32> {
        &self.scans
    }

    /// Whether the cell was seen free by one of the `within` scans before this one.
    pub(crate) fn lately(&self, cell: Cell, scan: u32, within: u32) -> bool {
        let last = self.scans.get(cell);
        last != 0 && scan.saturating_sub(last) <= within
    }

    /// An echo was the first thing in its beam: what lies before it is free. Silence tells nothing: a wall may be a mirror.
    pub(crate) fn see(&mut self, beam: &Beam, half_beam_rad: f64, scan: u32) {
        if beam.echo() {
            let cell = self.scans.cell_size();
            let scans = &mut self.scans;
            beam.visit_cone(cell, half_beam_rad, (beam.range_m() - BEFORE_ECHO_M).min(REACH_M), |cell| scans.set(cell, scan));
        }
    }

    /// Drops the tiles in which nothing was seen free by the last `within` scans: memory does not grow with the drive.
    pub(crate) fn forget(&mut self, scan: u32, within: u32) {
        let oldest = scan.saturating_sub(within);
        let fresh: Vec<(TileKey, _)> = self
            .scans
            .tiles()
            .filter(|(_, cells)| cells.iter().any(|last| *last >= oldest.max(1)))
            .map(|(key, cells)| (key, *cells))
            .collect();
        let mut scans = Lattice::new(self.scans.cell_size());
        fresh.iter().for_each(|(key, cells)| scans.set_tile(*key, cells));
        self.scans = scans;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use geometry::CellSize;
    use messages::{Pose, SonarReading};

    fn seen(range_m: f64, echo: u32) -> SeenFree {
        let mut seen = SeenFree::new(Lattice::new(CellSize::new(0.05).unwrap()));
        let reading = SonarReading { range_m, echo, ..SonarReading::default() };
        seen.see(&Beam::new(&Pose::default(), &reading, 0.2), 0.2, 7);
        seen
    }

    #[test]
    fn what_lies_before_an_echo_is_free_for_a_while() {
        let seen = seen(1.0, 1);
        let free = |column, scan| seen.lately(Cell { row: 0, column }, scan, 10);
        assert!(free(10, 8) && free(16, 17) && !free(17, 17) && !free(10, 18));
    }

    #[test]
    fn silence_frees_nothing_and_far_echoes_only_what_is_near() {
        assert!(!seen(3.0, 0).lately(Cell { row: 0, column: 5 }, 8, 10));
        let far = seen(2.9, 1);
        assert!(far.lately(Cell { row: 0, column: 43 }, 8, 10) && !far.lately(Cell { row: 0, column: 45 }, 8, 10));
    }

    #[test]
    fn what_was_not_seen_for_long_takes_no_memory() {
        let mut seen = seen(1.0, 1);
        seen.forget(17, 10);
        assert!(seen.scans().tile_count() > 0);
        seen.forget(18, 10);
        assert_eq!(seen.scans().tile_count(), 0);
    }
}
