//! Errors of TOML files, by type of problem.
#![allow(clippy::unwrap_used, clippy::panic, clippy::float_cmp, reason = "tests fail by panicking")]

use serde::Deserialize;
use stillmap_document::{Fault, parse, parse_checked};

#[derive(Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, expecting = "a table")]
struct Room {
    width_m: f64,
    #[serde(default)]
    doors: Vec<Door>,
    colour: Option<String>,
    number: Option<u8>,
}

#[derive(Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, expecting = "a table")]
struct Door {
    at: [f64; 2],
    #[serde(default)]
    kind: Kind,
}

#[derive(Debug, PartialEq, Default, Deserialize)]
#[serde(rename_all = "lowercase")]
enum Kind {
    #[default]
    Open,
    Ajar(f64),
}

/// Doors stand in the order of their x.
fn doors_ascend(room: &Room) -> Result<(), Fault> {
    match room.doors.windows(2).position(|pair| pair[0].at[0] > pair[1].at[0]) {
        Some(index) => Err(Fault::new(format!("doors[{}].at[0]", index + 1), "doors in the order of their x")),
        None => Ok(()),
    }
}

#[track_caller]
fn check(text: &str, expected: &str) {
    assert_eq!(parse_checked("room.toml", text, doors_ascend).unwrap_err().to_string(), expected);
}

#[test]
fn a_whole_file() {
    let text = "width_m = 4\ncolour = \"red\"\n[[doors]]\nat = [1, 0.5]\nkind = \"open\"\n[[doors]]\nat = [2.0, 0]\nkind = { ajar = 0.3 }";
    let room: Room = parse_checked("room.toml", text, doors_ascend).unwrap();
    let doors = vec![Door { at: [1.0, 0.5], kind: Kind::Open }, Door { at: [2.0, 0.0], kind: Kind::Ajar(0.3) }];
    assert_eq!(room, Room { width_m: 4.0, doors, colour: Some("red".to_owned()), number: None });
}

#[test]
fn numbers_are_finite() {
    check("width_m = nan", "room.toml:1: width_m = nan: expected a finite number");
    check("width_m = -inf", "room.toml:1: width_m = -inf: expected a finite number");
    check("width_m = 1e400", "room.toml:1: width_m = 1e400: expected a finite number");
    check("width_m = 1\n[[doors]]\nat = [\n  1,\n  inf]", "room.toml:5: doors[0].at[1] = inf: expected a finite number");
    check("number = 256", "room.toml:1: number = 256: expected a whole number in range");
    check("number = 1.0", "room.toml:1: number = 1.0: expected a whole number in range");
}

#[test]
fn values_of_another_type() {
    check("width_m = \"wide\"", "room.toml:1: width_m = \"wide\": expected a finite number");
    check("doors = 3", "room.toml:1: doors = 3: expected a list");
    check("doors = [\n3]", "room.toml:2: doors[0] = 3: expected a table");
    check("[[doors]]\nat = [1, 2]\nkind = \"shut\"", "room.toml:3: doors[0].kind = \"shut\": expected \"open\" or \"ajar\"");
    check("[[doors]]\nat = [1, 2]\nkind = { ajar = true }", "room.toml:3: doors[0].kind.ajar = true: expected a finite number");
    check("[[doors]]\nat = [1, 2, 3]", "room.toml:2: doors[0].at = [1, 2, 3]: expected a list of 2");
    check("[[doors]]\nat = [1]", "room.toml:2: doors[0].at = [1]: expected a list of 2");
}

#[test]
fn faults_are_told_with_the_line_and_value_of_their_key() {
    check(
        "width_m = 1\ndoors = [\n  { at = [2, 0] },\n  { at = [1, 0] },\n]",
        "room.toml:4: doors[1].at[0] = 1: expected doors in the order of their x",
    );
}

#[test]
fn without_a_check() {
    assert_eq!(parse::<Room>("room.toml", "width_m = 2").unwrap().width_m, 2.0);
    assert_eq!(parse::<Room>("room.toml", "").unwrap_err().to_string(), "room.toml:1: width_m: missing, expected this key");
}
