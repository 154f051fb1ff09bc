//! The examples of drivers of one's own, in Rust and in Python, in a deployment.

use std::path::{Path, PathBuf};
use std::process::Command;

use crate::harness::processes::kill;
use crate::harness::{Deployment, Ended, FREE, OCCUPIED, PgmMap, Sandbox};

/// The example's program. Examples are built beside the command.
pub(crate) fn text_driver() -> PathBuf {
    let driver = PathBuf::from(env!("CARGO_BIN_EXE_stillmap")).with_file_name("examples").join("text_driver");
    assert!(driver.exists(), "{} is missing: cargo build --example text_driver", driver.display());
    driver
}

/// Drives by these scans.
fn drive(sandbox: &Sandbox, scans: &str) -> Ended {
    let scans = sandbox.write("scans.txt", scans);
    let own = Deployment::new("own", &["mapping"]).set("supervisor.restarts", 0).with_driver([text_driver(), scans]);
    sandbox.run(&own, &[]).end()
}

#[test]
fn a_text_file_of_scans_becomes_a_map() {
    let sandbox = Sandbox::new();
    // The robot stands at the origin; a sonar at its front looks at a wall 1.5 m ahead of it.
    let lines: Vec<String> = (1..=60).map(|k| format!("{} 0 0 0  0.1 0 0 1.4", f64::from(k) * 0.1)).collect();
    drive(&sandbox, &lines.join("\n")).map();
    let map = PgmMap::read(&sandbox.path("own-out"));
    assert_eq!((map.at(1.5, 0.0), map.at(0.8, 0.0)), (OCCUPIED, FREE));
}

#[test]
fn a_malformed_line_fails_the_run_and_is_named() {
    let ended = drive(&Sandbox::new(), "0.1 0 0 0\n0.2 0 0\n");
    ended.assert_code(3);
    assert!(ended.stderr.contains("Error: line 2 has 3 numbers, expected at least 4"), "{}", ended.stderr);
}

/// A robot that drives past a wall.
fn scans() -> String {
    let line = |k: u32| format!("{} {} 0 0  0.1 0 1.57 1.4  0 0.1 0 2.9", f64::from(k) * 0.1, f64::from(k) * 0.01);
    (1..=300).map(line).collect::<Vec<_>>().join("\n")
}

/// The file of an example in Python; none where iceoryx2's package is not installed.
fn python_example(name: &str) -> Option<PathBuf> {
    let import = Command::new("python3").args(["-c", "import iceoryx2"]).output();
    if import.is_ok_and(|output| output.status.success()) {
        return Some(Path::new(env!("CARGO_MANIFEST_DIR")).join("examples").join(name));
    }
    eprintln!("skipped: python3 has no package iceoryx2");
    None
}

#[test]
fn a_killed_driver_in_python_gives_the_map_of_one_in_rust() {
    let Some(driver) = python_example("driver.py") else { return };
    let sandbox = Sandbox::new();
    let expected = drive(&sandbox, &scans()).map();
    let command = ["python3".into(), driver, sandbox.path("scans.txt")];
    let own = Deployment::new("python", &["mapping"]).tireless().patient().with_driver(command);
    let mut run = sandbox.run(&own, &[]);
    kill(run.wait_for("driver", "it sends", |it| it.sent > 0).pid);
    let ended = run.end();
    assert_eq!(ended.restarted(), Some("driver once"), "{}", ended.stderr);
    assert_eq!(ended.map(), expected);
}

#[test]
fn a_listener_in_python_receives_every_scan() {
    let Some(listener) = python_example("listen.py") else { return };
    let sandbox = Sandbox::new();
    let file = sandbox.write("scans.txt", &scans());
    let own = Deployment::new("own", &["mapping"]).with_driver([text_driver(), file]);
    let mut run = sandbox.run(&own, &[]);
    run.pid_of("driver");
    let mut command = sandbox.program("python3");
    let output = command.arg(listener).arg("own").output().unwrap();
    run.end().map();
    let text = String::from_utf8(output.stdout).unwrap();
    let lines: Vec<&str> = text.lines().collect();
    assert_eq!(lines.len(), 301, "{text}{}", String::from_utf8_lossy(&output.stderr));
    assert_eq!((lines[0], lines[300]), ("scan 1: x 0.010 m, y 0.000 m, 2 readings", "the stream ends after scan 300"));
}
