//! The digest of a map: one number for its cells and their placement.

use geometry::Lattice;
use sha2::{Digest, Sha256};

/// What the digest is over begins with this, so that another definition never gives the same number.
const DEFINITION: &[u8] = b"stillmap map 1";

/// SHA-256 of a lattice of log-odds, and the number of tiles it is over.
///
/// It is over the definition's name, then the edge of a cell in m (f64), then each tile that holds a cell other than 0, by rows and
/// then columns of tiles: its row and column (i32) and its 1024 cells (f32), row by row. All numbers little-endian.
pub(crate) fn digest(lattice: &Lattice<f32>) -> ([u8; 32], u64) {
    let mut hash = Sha256::new();
    hash.update(DEFINITION);
    hash.update(lattice.cell_size().metres().to_le_bytes());
    let mut tiles = 0;
    for (key, cells) in lattice.tiles().filter(|(_, cells)| cells.iter().any(|&cell| cell != 0.0)) {
        hash.update(key.row.to_le_bytes());
        hash.update(key.column.to_le_bytes());
        for cell in cells {
            // Adding 0 makes −0 the same as 0, which it is to every reader.
            hash.update((cell + 0.0).to_le_bytes());
        }
        tiles += 1;
    }
    (hash.finalize().into(), tiles)
}

#[cfg(test)]
mod tests {
    use super::*;
    use geometry::{Cell, CellSize};

    fn with(cells: &[(i32, i32, f32)]) -> ([u8; 32], u64) {
        let mut lattice = Lattice::new(CellSize::new(0.05).unwrap());
        cells.iter().for_each(|&(row, column, value)| lattice.set(Cell { row, column }, value));
        digest(&lattice)
    }

    #[test]
    fn value_and_place_of_every_cell_count() {
        let one = with(&[(3, 4, 0.5)]);
        assert_ne!(one, with(&[(3, 4, 0.500_000_06)]));
        assert_ne!(one, with(&[(3, 5, 0.5)]));
        assert_ne!(one, with(&[(35, 4, 0.5)]));
    }

    #[test]
    fn what_is_unknown_and_the_order_of_writing_do_not_count() {
        let one = with(&[(3, 4, 0.5), (300, 4, -0.5)]);
        assert_eq!(one.1, 2);
        assert_eq!(one, with(&[(300, 4, -0.5), (-900, 0, 0.0), (3, 4, 0.5), (3, 5, -0.0)]));
    }

    #[test]
    fn the_definition_stays() {
        let hex: String = with(&[]).0.iter().map(|byte| format!("{byte:02x}")).collect();
        let expected = Sha256::digest([DEFINITION, &0.05_f64.to_le_bytes()].concat());
        assert_eq!(hex, expected.iter().map(|byte| format!("{byte:02x}")).collect::<String>());
    }
}
