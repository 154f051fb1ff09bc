//! The log of a real robot: imported, replayed, and its walls looked at. Skipped where the recording is absent.
#![expect(clippy::unwrap_used, clippy::panic, reason = "tests fail by panicking")]

mod harness;

use std::path::Path;

use harness::{Bench, FREE, OCCUPIED, PgmMap, map_sha256, text};

const RECORDING: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/data/sonar_log");

#[test]
fn the_corridor_of_a_real_robot() {
    if !Path::new(RECORDING).is_dir() {
        println!("SKIPPED: the recording sonar_log is not here");
        return;
    }
    let bench = Bench::new();
    let log = bench.path("real.mcap");
    let import = bench.output(["log", "import", "--format", "robond", RECORDING, "--out", log.to_str().unwrap()]);
    assert_eq!(import.status.code(), Some(0), "{}", text(&import.stderr));
    let first = map_sha256(&bench.output(["replay", log.to_str().unwrap(), "--out", bench.path("a").to_str().unwrap()]));
    let second = map_sha256(&bench.output(["replay", log.to_str().unwrap(), "--out", bench.path("b").to_str().unwrap()]));
    assert_eq!(first, second);
    let map = PgmMap::read(&bench.path("a"));
    assert!(map.count(OCCUPIED) > 300 && map.count(FREE) > 3000, "{} occupied, {} free", map.count(OCCUPIED), map.count(FREE));
}
