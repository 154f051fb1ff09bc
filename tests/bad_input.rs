//! Files that cannot be used: one clear line, exit code 2, nothing written, nothing left.
#![expect(clippy::unwrap_used, clippy::panic, reason = "tests fail by panicking")]

mod harness;

use std::path::Path;

use harness::{Bench, text};

const DEMO: &str = include_str!("../config/demo.toml");
const WORLD: &str = include_str!("../config/worlds/hall.toml");

#[track_caller]
fn refuses(bench: &Bench, arguments: &[&str], expected: &[&str]) {
    let output = bench.output(arguments);
    let said = text(&output.stderr);
    let errors: Vec<&str> = said.lines().filter(|line| line.starts_with("error: ")).collect();
    assert_eq!(output.status.code(), Some(2), "{arguments:?}: {said}");
    assert_eq!(errors.len(), 1, "{arguments:?}: {said}");
    for word in expected {
        assert!(errors[0].contains(word), "{arguments:?}: {word:?} is missing in {:?}", errors[0]);
    }
}

fn name(path: &Path) -> &str {
    path.to_str().unwrap()
}

#[test]
fn settings() {
    let bench = Bench::new();
    let world = bench.write("hall.toml", WORLD);
    let demo = DEMO.replace("worlds/hall.toml", name(&world));
    let good = bench.write("good.toml", &demo);
    assert_eq!(bench.output(["check", name(&good)]).status.code(), Some(0));

    for (from, to, expected) in [
        ("cell_m = 0.05", "cell_m = -1.0", &["bad.toml:", "mapping.cell_m", "-1"][..]),
        ("cell_m = 0.05", "cel_m = 0.05", &["bad.toml:", "cel_m", "cell_m"]),
        ("model = \"pioneer-1\"", "model = \"pioneer-9\"", &["bad.toml:", "robot.model", "pioneer-9", "p3-dx"]),
        ("[robot]", "[robot", &["bad.toml:"]),
        ("run = \"pioneer\"", "run = \"pionier\"", &["bad.toml:", "pionier"]),
    ] {
        assert!(demo.contains(from));
        let bad = bench.write("bad.toml", &demo.replacen(from, to, 1));
        refuses(&bench, &["check", name(&bad)], expected);
        refuses(&bench, &["run", name(&bad)], expected);
    }
    refuses(&bench, &["run", "nowhere.toml"], &["nowhere.toml"]);
}

#[test]
fn worlds() {
    let bench = Bench::new();
    let out = bench.path("out");
    for (from, to) in [
        ("speed_m_s = 0.28", "speed_m_s = -3"),
        ("[robot]", "[robbot]"),
        ("along_m = [[0, 0], [12, 0], [12, 7], [0, 7], [0, 0]]", "along_m = [[0, 0]]"),
    ] {
        assert!(WORLD.contains(from));
        let bad = bench.write("bad-world.toml", &WORLD.replacen(from, to, 1));
        refuses(&bench, &["demo", "--world", name(&bad), "--out", name(&out)], &["bad-world.toml:"]);
    }
    assert_eq!(bench.left_behind(), Vec::<std::path::PathBuf>::new());
}

#[test]
fn logs() {
    let bench = Bench::new();
    for (file, bytes) in [("empty.mcap", &b""[..]), ("text.mcap", b"a line of text\n"), ("zeros.mcap", &[0; 4096])] {
        let path = bench.path(file);
        std::fs::write(&path, bytes).unwrap();
        refuses(&bench, &["replay", name(&path)], &[file]);
        refuses(&bench, &["log", "info", name(&path)], &[file]);
    }
    refuses(&bench, &["replay", "nowhere.mcap"], &["nowhere.mcap"]);
}

#[test]
fn faults() {
    let bench = Bench::new();
    for (arguments, expected) in [
        (&["--service", "map/tile", "drop"][..], &["--service", "'map/tile'", "expected robot/scan, motion/sonar"][..]),
        (&["--process", "a process", "kill"], &["--process", "'a process'", "1 to 24 of a-z"]),
        (&["--process", "std", "Stop"], &["'Stop'", "expected drop, delay"]),
        (&["--service", "map/verdict", "kill"], &["kill --service map/verdict: expected a service with"]),
        (&["memory", "--process", "std"], &["memory --process std: expected a service with"]),
        (&["drop"], &["drop: expected a service with"]),
        (&["--service", "robot/scan", "drop", "--rate", "nan"], &["--rate", "'nan'", "expected 0 to 1"]),
        (&["--service", "robot/scan", "delay", "--by", "-5"], &["--by", "'-5'", "expected 0.001 to 3600 s"]),
        (&["--service", "robot/scan", "delay", "--for", "1e9"], &["--for", "'1e9'", "expected 0 to 86400 s"]),
    ] {
        refuses(&bench, &[&["inject"], arguments].concat(), expected);
    }
}
