//! The generated files beside the deployments are those of the code.
#![allow(clippy::unwrap_used, clippy::panic, reason = "tests fail by panicking")]

use std::path::Path;

use stillmap_settings::{Settings, reference, schema};

#[track_caller]
fn check_current(file: &str, option: &str, expected: &str) {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../config").join(file);
    let found = std::fs::read_to_string(&path).unwrap_or_default();
    assert!(found == expected, "config/{file} is out of date; renew it: cargo run --release -- check {option} > config/{file}");
}

#[test]
fn the_schema_is_current() {
    check_current("settings.schema.json", "--schema", &schema());
}

#[test]
fn the_reference_is_current() {
    check_current("SETTINGS.md", "--reference", &reference());
}

#[test]
fn the_reference_tells_of_every_key() {
    let page = reference();
    let mut missing = Vec::new();
    let effective = toml::Value::try_from(Settings::default()).unwrap();
    let mut tables = vec![effective.as_table().unwrap().clone()];
    while let Some(table) = tables.pop() {
        for (key, value) in table {
            match value {
                toml::Value::Table(within) => tables.push(within),
                _ if key == "process" => {}
                _ if page.contains(&format!("| `{key}` |")) => {}
                _ => missing.push(key),
            }
        }
    }
    assert!(missing.is_empty(), "{missing:?}");
}

#[test]
fn every_meaning_stands_alone() {
    for row in reference().lines().filter(|line| line.starts_with("| `")) {
        let meaning = row.trim_end_matches(" |").rsplit(" | ").next().unwrap();
        assert!(meaning.starts_with(|first: char| first.is_uppercase()) && meaning.ends_with('.'), "{row}");
        assert!(!meaning.contains("; "), "one sentence leans on another: {row}");
    }
}

#[test]
fn the_reference_tells_limits_units_and_defaults() {
    let page = reference();
    for row in [
        "| `cell_m` | 0.005 to 1 m | `0.05` | Edge length of a cell. |",
        "| `pace` | `\"live\"`, `\"lockstep\"` | `\"live\"` |",
        "| `odometry_modulus` | `4096`, `32768`, `65536` | `32768` |",
        "| `gain` | 3 × 3: each 0 to 1 | `[[0.0, 0.0, 0.0], [0.5, 0.5, 0.5], [1.0, 1.0, 1.0]]` |",
        "| `name` | 1 to 24 of a-z, 0-9 and - | **required** |",
        "| `window` | whole number, 1 to 256 scans | `256` |",
        "## [mapping.tuning]\n",
        "## [[robot.sonar]], 0 to 32 times\n",
    ] {
        assert!(page.contains(row), "{row}");
    }
}
