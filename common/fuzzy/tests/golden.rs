//! Eq. 1 through the paper's Tables 3, 4 and 5, against values computed by two independent writings.

#![allow(clippy::unwrap_used, clippy::panic, reason = "tests fail by panicking")]

use serde_json::Value;
use stillmap_fuzzy::{Partition, RuleTable};

/// Rows: sets of C; columns: sets of B; entries: sets of O. All from the smallest set up, as printed.
const CENTROID_X: [&str; 5] = ["VS S S M M", "VS S M M L", "S S M L L", "M M M L VL", "L M L L VL"];
const CENTROID_Y: [&str; 5] = ["NB NS NS Z Z", "NB NS Z Z PS", "NS NS Z PS PS", "Z Z Z PS PB", "PS Z PS PS PB"];
const SIZE: [&str; 5] = ["VS S S L VL", "S S M L VL", "M M M L VL", "L L L L VL", "VL VL VL VL VL"];

const MAGNITUDES: [&str; 5] = ["VS", "S", "M", "L", "VL"];
const SIDES: [&str; 5] = ["NB", "NS", "Z", "PS", "PB"];

/// Five evenly spaced centres.
fn evenly(low: f64, high: f64) -> Vec<f64> {
    (0..5).map(|k| low + (high - low) * f64::from(k) / 4.0).collect()
}

fn table(rows: [&str; 5], names: [&str; 5], c: (f64, f64), b: (f64, f64), o: (f64, f64)) -> RuleTable<2> {
    let outputs = evenly(o.0, o.1);
    let rules = rows.iter().flat_map(|row| row.split(' ')).map(|set| outputs[names.iter().position(|n| *n == set).unwrap()]).collect();
    RuleTable::new([Partition::new(evenly(c.0, c.1)).unwrap(), Partition::new(evenly(b.0, b.1)).unwrap()], rules).unwrap()
}

#[test]
fn tables_3_to_5_give_the_golden_outputs() {
    // Ranges as in the file's note: CH 3 m, CW 4.6 m, IH 120, IW 160, C_Size to 100 cells, B_Size to 4800 px, O_Size to 100 cells.
    let tables = [
        table(CENTROID_X, MAGNITUDES, (0.0, 3.0), (0.0, 120.0), (0.0, 3.0)),
        table(CENTROID_Y, SIDES, (-2.3, 2.3), (-80.0, 80.0), (-2.3, 2.3)),
        table(SIZE, MAGNITUDES, (0.0, 100.0), (0.0, 4800.0), (0.0, 100.0)),
    ];
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/data/sonar/fuzzy.json");
    let golden: Value = serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap();
    let cases = golden["fuzzy"].as_array().unwrap();
    assert_eq!(cases.len(), 30);
    for case in cases {
        for (variable, table) in tables.iter().enumerate() {
            let number = |key: &str| case[key][variable].as_f64().unwrap();
            let y = table.infer([number("C"), number("B")]);
            assert!((y - number("O")).abs() < 1e-6, "variable {variable} of {case}: {y}");
        }
    }
}
