//! The example of a driver of one's own, in a deployment.
#![expect(clippy::unwrap_used, clippy::panic, reason = "tests fail by panicking")]

mod harness;

use harness::{Bench, FREE, OCCUPIED, PgmMap, map_sha256, text};
use std::path::Path;

/// What becomes of these scans.
fn drive(bench: &Bench, scans: &str) -> std::process::Output {
    let scans = bench.write("scans.txt", scans);
    // Examples are built beside the command.
    let driver = Path::new(env!("CARGO_BIN_EXE_stillmap")).with_file_name("examples").join("text_driver");
    assert!(driver.exists(), "{} is missing: cargo build --release --example text_driver", driver.display());
    let settings = format!(
        "name = \"own\"\nout = \"out\"\n[supervisor]\nrestarts = 0\n[[process]]\nname = \"mapping\"\nrun = \"mapping\"\n\
         [[process]]\nname = \"driver\"\ncommand = [{driver:?}, {scans:?}]\nends_run = true\n"
    );
    bench.output(["run", bench.write("own.toml", &settings).to_str().unwrap()])
}

#[test]
fn a_text_file_becomes_a_map() {
    let bench = Bench::new();
    // The robot stands at the origin; a sonar at its front looks at a wall 1.5 m ahead of it.
    let lines: Vec<String> = (1..=60).map(|k| format!("{} 0 0 0  0.1 0 0 1.4", f64::from(k) * 0.1)).collect();
    map_sha256(&drive(&bench, &lines.join("\n")));
    let map = PgmMap::read(&bench.path("out"));
    assert_eq!((map.at(1.5, 0.0), map.at(0.8, 0.0)), (OCCUPIED, FREE));
}

#[test]
fn a_line_that_is_no_scan_is_named() {
    let output = drive(&Bench::new(), "0.1 0 0 0\n0.2 0 0\n");
    assert!(!output.status.success());
    assert!(text(&output.stderr).contains("Error: line 2 has 3 numbers, expected at least 4"), "{}", text(&output.stderr));
}
