//! Classes of adjacent cells (paper section 4.2).

use std::collections::BTreeSet;

use geometry::Cell;

use crate::tvm::Tagged;

/// Cells that touch each other by an edge or a corner.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Class {
    pub(crate) cells: Vec<Cell>,
    /// Bit i: the echo of reading i fell in one of them.
    pub(crate) readings: u32,
}

/// The classes of the cells tagged by a scan, in the order of their first cells.
pub(crate) fn classes(tagged: &Tagged) -> Vec<Class> {
    let mut unassigned: BTreeSet<Cell> = tagged.keys().copied().collect();
    let mut classes = Vec::new();
    while let Some(seed) = unassigned.pop_first() {
        let mut class = Class { cells: Vec::new(), readings: 0 };
        let mut front = vec![seed];
        while let Some(cell) = front.pop() {
            class.cells.push(cell);
            class.readings |= tagged.get(&cell).copied().unwrap_or_default();
            front.extend(neighbours(cell).filter(|neighbour| unassigned.remove(neighbour)));
        }
        classes.push(class);
    }
    classes
}

fn neighbours(cell: Cell) -> impl Iterator<Item = Cell> {
    (-1..=1).flat_map(move |down| {
        (-1..=1).map(move |right| Cell { row: cell.row.saturating_add(down), column: cell.column.saturating_add(right) })
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_that_touch_at_a_corner_are_one_class() {
        let tagged: Tagged = [((0, 0), 1), ((1, 1), 2), ((0, 5), 4), ((3, 1), 8)]
            .map(|((row, column), readings)| (Cell { row, column }, readings))
            .into_iter()
            .collect();
        let classes = classes(&tagged);
        let found: Vec<(usize, u32)> = classes.iter().map(|class| (class.cells.len(), class.readings)).collect();
        assert_eq!(found, [(2, 3), (1, 4), (1, 8)]);
    }
}
