//! The log of a real robot: imported, replayed, and its walls checked. Skipped where the recording is absent.

use std::path::Path;

use crate::harness::{FREE, OCCUPIED, PgmMap, Sandbox};

const RECORDING: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../shared/data/sonar_log");

#[test]
fn the_log_of_a_real_robot_maps_straight_walls() {
    if !Path::new(RECORDING).is_dir() {
        eprintln!("skipped: the recording sonar_log is not here");
        return;
    }
    let sandbox = Sandbox::new();
    let log = sandbox.path("real.mcap");
    sandbox.output(["log", "import", "--format", "robond", RECORDING, "--out", log.to_str().unwrap()]).assert_code(0);
    assert_eq!(sandbox.replayed(&log, "a"), sandbox.replayed(&log, "b"));
    let map = PgmMap::read(&sandbox.path("a"));
    let walls = [("left", [0.5, 1.2], [8.0, 1.2], 0.9), ("right", [0.7, -0.9], [7.0, -0.9], 0.75)];
    for (side, from, to, share) in walls {
        let found = map.wall_share(from, to, 0.15);
        assert!(found > share, "the {side} wall of the first corridor is straight over {found:.2} of its length, expected {share}");
    }
    assert!(map.count(OCCUPIED) > 300 && map.count(FREE) > 3000, "{} occupied, {} free", map.count(OCCUPIED), map.count(FREE));
}
