//! The example of a driver of one's own, in a deployment.

use std::path::PathBuf;

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
