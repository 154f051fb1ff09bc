//! Unusable files and arguments: one error line, exit code 2, nothing left.

use std::path::Path;

use toml::{Table, Value};

use crate::harness::{Deployment, Sandbox, worlds};

#[track_caller]
fn assert_refused(sandbox: &Sandbox, arguments: &[&str], expected: &[&str]) {
    let ended = sandbox.output(arguments);
    let errors: Vec<&str> = ended.stderr.lines().filter(|line| line.starts_with("error: ")).collect();
    ended.assert_code(2);
    assert_eq!(errors.len(), 1, "{arguments:?}: {}", ended.stderr);
    for word in expected {
        assert!(errors[0].contains(word), "{arguments:?}: {word:?} is missing in {:?}", errors[0]);
    }
}

fn name(path: &Path) -> &str {
    path.to_str().unwrap()
}

#[test]
fn unusable_settings_are_refused_with_file_and_key() {
    let sandbox = Sandbox::new();
    let demo = Deployment::demo();
    sandbox.output(["check", name(&demo.write(&sandbox))]).assert_code(0);
    let settings = |demo: Deployment| demo.to_toml();
    let unknown_program = demo.clone().without("pioneer").with("pionier");
    for (settings, expected) in [
        (settings(demo.clone().set("mapping.cell_m", -1.0)), &["bad.toml:", "mapping.cell_m", "-1"][..]),
        (settings(demo.clone().set("mapping.cel_m", 0.05)), &["bad.toml:", "cel_m", "cell_m"]),
        (settings(demo.clone().set("robot.model", "pioneer-9")), &["bad.toml:", "robot.model", "pioneer-9", "p3-dx"]),
        (settings(demo) + "[std", &["bad.toml:"]),
        (settings(unknown_program), &["bad.toml:", "pionier"]),
    ] {
        let bad = sandbox.write("bad.toml", &settings);
        assert_refused(&sandbox, &["check", name(&bad)], expected);
        assert_refused(&sandbox, &["run", name(&bad)], expected);
    }
    assert_refused(&sandbox, &["run", "nowhere.toml"], &["nowhere.toml"]);
}

#[test]
fn unusable_worlds_are_refused_with_their_file() {
    let sandbox = Sandbox::new();
    let out = sandbox.path("out");
    let bad = |change: fn(&mut Table)| {
        let mut world = worlds::read("hall");
        change(&mut world);
        world
    };
    for world in [
        bad(|world| world["robot"]["speed_m_s"] = Value::from(-3)),
        bad(|world| drop(world.insert("robbot".to_owned(), Value::Table(Table::new())))),
        bad(|world| world["wall"][0]["along_m"].as_array_mut().unwrap().truncate(1)),
    ] {
        let world = worlds::write(&sandbox, &world);
        assert_refused(&sandbox, &["check", name(&world)], &["world.toml:"]);
        assert_refused(&sandbox, &["demo", "--world", name(&world), "--out", name(&out)], &["world.toml:"]);
    }
}

#[test]
fn files_that_are_no_logs_are_refused_with_their_name() {
    let sandbox = Sandbox::new();
    for (file, bytes) in [("empty.mcap", &b""[..]), ("text.mcap", b"a line of text\n"), ("zeros.mcap", &[0; 4096])] {
        let path = sandbox.path(file);
        std::fs::write(&path, bytes).unwrap();
        assert_refused(&sandbox, &["replay", name(&path)], &[file]);
        assert_refused(&sandbox, &["log", "info", name(&path)], &[file]);
    }
    assert_refused(&sandbox, &["replay", "nowhere.mcap"], &["nowhere.mcap"]);
}

#[test]
fn faults_that_cannot_be_injected_are_refused() {
    let sandbox = Sandbox::new();
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
        assert_refused(&sandbox, &[&["inject"], arguments].concat(), expected);
    }
}
