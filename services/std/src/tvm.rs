//! The time-variant map (paper section 4.1): which cells echoes fell in, scan by scan.

use std::collections::{BTreeMap, VecDeque};

use geometry::Beam;
use geometry::{Cell, CellSize};

/// The cells tagged by one scan, each with the readings whose echo fell in it (bit i: reading i).
pub(crate) type Tagged = BTreeMap<Cell, u32>;

/// TVM_{t−n} … TVM_{t−1}: the tags of the last scans. Older tags have left.
#[derive(Debug, Clone, Default, PartialEq)]
pub(crate) struct TimeVariantMap {
    /// Cells of each scan in order, the oldest first.
    scans: VecDeque<Vec<Cell>>,
}

/// The cells that a scan's echoes fall in: of each echo its arc, one cell deep to either side, so that detection does not
/// hang on the beam's axis.
pub(crate) fn tag<'a>(cell: CellSize, beams: impl Iterator<Item = (usize, &'a Beam)>) -> Tagged {
    let mut tagged = Tagged::new();
    for (reading, beam) in beams {
        for cell in beam.arc(cell, cell.metres()) {
            *tagged.entry(cell).or_default() |= 1 << reading;
        }
    }
    tagged
}

impl TimeVariantMap {
    pub(crate) fn from_scans(scans: VecDeque<Vec<Cell>>) -> Self {
        Self { scans }
    }

    pub(crate) fn scans(&self) -> &VecDeque<Vec<Cell>> {
        &self.scans
    }

    /// Whether the cell, or one within the tolerance, carries a tag of the last scans.
    pub(crate) fn tagged_lately(&self, cell: Cell, tolerance: u32) -> bool {
        let reach = tolerance as i32;
        (cell.row.saturating_sub(reach)..=cell.row.saturating_add(reach)).any(|row| {
            let first = Cell { row, column: cell.column.saturating_sub(reach) };
            let last = Cell { row, column: cell.column.saturating_add(reach) };
            self.scans.iter().any(|cells| {
                let start = cells.partition_point(|c| *c < first);
                cells.get(start).is_some_and(|c| *c <= last)
            })
        })
    }

    /// Takes in the tags of the newest scan and drops those older than the span.
    pub(crate) fn remember(&mut self, tagged: &Tagged, span_scans: u32) {
        self.scans.push_back(tagged.keys().copied().collect());
        while self.scans.len() > span_scans as usize {
            self.scans.pop_front();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tagged(cells: &[(i32, i32)]) -> Tagged {
        cells.iter().map(|&(row, column)| (Cell { row, column }, 1)).collect()
    }

    #[test]
    fn a_tag_holds_for_the_span_and_within_the_tolerance() {
        let mut tvm = TimeVariantMap::default();
        tvm.remember(&tagged(&[(5, 5), (9, 9)]), 2);
        tvm.remember(&tagged(&[]), 2);
        let at = |tvm: &TimeVariantMap, row, column, tolerance| tvm.tagged_lately(Cell { row, column }, tolerance);
        assert!(at(&tvm, 5, 5, 0) && !at(&tvm, 5, 6, 0));
        assert!(at(&tvm, 4, 6, 1) && at(&tvm, 6, 4, 1) && !at(&tvm, 7, 5, 1) && !at(&tvm, 5, 3, 1));
        tvm.remember(&tagged(&[]), 2);
        assert!(!at(&tvm, 5, 5, 1));
        assert_eq!(tvm.scans().len(), 2);
    }
}
