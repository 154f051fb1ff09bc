//! Eq. 1 through Tables 3, 4 and 5.

use fuzzy::{Partition, RuleTable};

/// Sets of a variable that counts from 0.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Magnitude {
    /// Very small.
    VS,
    /// Small.
    S,
    /// Medium.
    M,
    /// Large.
    L,
    /// Very large.
    VL,
}

/// Sets of a variable that counts to either side of 0.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Side {
    /// Negative, big.
    NB,
    /// Negative, small.
    NS,
    /// Zero.
    Z,
    /// Positive, small.
    PS,
    /// Positive, big.
    PB,
}

/// Tables 3 to 5 of the paper. Rows: sets of C (sonars), columns: sets of B (camera), in the order of the sets; the defaults are as
/// printed, odd entries included.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Tables {
    /// Table 3: O_Centroid.x.
    pub centroid_x: [[Magnitude; 5]; 5],
    /// Table 4: O_Centroid.y.
    pub centroid_y: [[Side; 5]; 5],
    /// Table 5: O_Size.
    pub size: [[Magnitude; 5]; 5],
}

impl Default for Tables {
    fn default() -> Self {
        use Magnitude::{L, M, S, VL, VS};
        use Side::{NB, NS, PB, PS, Z};
        Self {
            centroid_x: [[VS, S, S, M, M], [VS, S, M, M, L], [S, S, M, L, L], [M, M, M, L, VL], [L, M, L, L, VL]],
            centroid_y: [[NB, NS, NS, Z, Z], [NB, NS, Z, Z, PS], [NS, NS, Z, PS, PS], [Z, Z, Z, PS, PB], [PS, Z, PS, PS, PB]],
            size: [[VS, S, S, L, VL], [S, S, M, L, VL], [M, M, M, L, VL], [L, L, L, L, VL], [VL, VL, VL, VL, VL]],
        }
    }
}

/// A moving object by one sense, in the robot frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Seen {
    /// Forward, m.
    pub(crate) x: f64,
    /// To the left, m.
    pub(crate) y: f64,
    /// In cells for C and O, in px for B.
    pub(crate) size: f64,
}

/// Size of the paper's picture, px.
pub(crate) const PAPER_PIXELS: f64 = 160.0 * 120.0;

/// The ranges of the variables; the sets are evenly spaced over them.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Ranges {
    /// CH, m.
    pub(crate) forward_m: f64,
    /// CW, m.
    pub(crate) width_m: f64,
    /// `C_Size` and `O_Size`, cells.
    pub(crate) cells: f64,
    /// `B_Size`, px.
    pub(crate) pixels: f64,
}

/// The fuzzy system from C and B to O.
#[derive(Debug, Clone)]
pub(crate) struct Integration {
    centroid_x: RuleTable<2>,
    centroid_y: RuleTable<2>,
    size: RuleTable<2>,
}

impl Integration {
    /// `None` for ranges that are no positive numbers.
    pub(crate) fn new(tables: &Tables, ranges: &Ranges) -> Option<Self> {
        let magnitude = |rows: &[[Magnitude; 5]; 5], c: f64, b: f64| table(rows.map(|row| row.map(|set| set as usize)), [0.0, c], [0.0, b]);
        let half_m = ranges.width_m / 2.0;
        Some(Self {
            centroid_x: magnitude(&tables.centroid_x, ranges.forward_m, ranges.forward_m)?,
            centroid_y: table(tables.centroid_y.map(|row| row.map(|set| set as usize)), [-half_m, half_m], [-half_m, half_m])?,
            size: magnitude(&tables.size, ranges.cells, ranges.pixels)?,
        })
    }

    /// `O_Centroid` and `O_Size` of a corresponding pair.
    pub(crate) fn infer(&self, c: &Seen, b: &Seen) -> Seen {
        Seen { x: self.centroid_x.infer([c.x, b.x]), y: self.centroid_y.infer([c.y, b.y]), size: self.size.infer([c.size, b.size]) }
    }
}

/// A table of which C and O have one range, B another.
fn table(sets: [[usize; 5]; 5], c: [f64; 2], b: [f64; 2]) -> Option<RuleTable<2>> {
    let outputs = evenly(c);
    let rules = sets.into_iter().flatten().filter_map(|set| outputs.get(set).copied()).collect();
    RuleTable::new([Partition::new(evenly(c)).ok()?, Partition::new(evenly(b)).ok()?], rules).ok()
}

/// Five evenly spaced centres.
pub(crate) fn evenly([low, high]: [f64; 2]) -> Vec<f64> {
    (0..5).map(|k| low + (high - low) * f64::from(k) / 4.0).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::Value;

    #[test]
    fn the_tables_give_the_golden_outputs() {
        // Ranges as in the file's note; rows and columns of the picture are scaled to CH and CW.
        let integration =
            Integration::new(&Tables::default(), &Ranges { forward_m: 3.0, width_m: 4.6, cells: 100.0, pixels: 4800.0 }).unwrap();
        let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/data/sonar/fuzzy.json");
        let golden: Value = serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap();
        let cases = golden["fuzzy"].as_array().unwrap();
        assert_eq!(cases.len(), 30);
        for case in cases {
            let [c, b, o] = ["C", "B", "O"].map(|key| [0, 1, 2].map(|i| case[key][i].as_f64().unwrap()));
            let seen = Seen { x: b[0] * 3.0 / 120.0, y: b[1] * 4.6 / 160.0, size: b[2] };
            let found = integration.infer(&Seen { x: c[0], y: c[1], size: c[2] }, &seen);
            for (found, expected) in [found.x, found.y, found.size].into_iter().zip(o) {
                assert!((found - expected).abs() < 1e-6, "{case}: {found}");
            }
        }
    }

    #[test]
    fn ranges_that_are_none_make_no_system() {
        let ranges = Ranges { forward_m: 0.0, width_m: 4.6, cells: 100.0, pixels: 4800.0 };
        assert!(Integration::new(&Tables::default(), &ranges).is_none());
    }
}
