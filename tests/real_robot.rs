//! The log of a real robot: imported, replayed, and its walls looked at. Skipped where the recording is absent.
#![expect(clippy::unwrap_used, clippy::panic, clippy::print_stdout, reason = "tests fail by panicking, and say what they skip")]

mod harness;

use std::path::Path;

use harness::{Bench, FREE, OCCUPIED, PgmMap, map_sha256, text};

const RECORDING: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../shared/data/sonar_log");

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
    let walls = [("left", [0.5, 1.2], [8.0, 1.2], 0.9), ("right", [0.7, -0.9], [7.0, -0.9], 0.75)];
    for (side, from, to, share) in walls {
        let found = map.wall_share(from, to, 0.15);
        assert!(found > share, "the {side} wall of the first corridor is straight over {found:.2} of its length, expected {share}");
    }
    assert!(map.count(OCCUPIED) > 300 && map.count(FREE) > 3000, "{} occupied, {} free", map.count(OCCUPIED), map.count(FREE));
}
