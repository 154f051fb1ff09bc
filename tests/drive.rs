//! A simulated drive from serial bytes to a map, and the same map from its log.
#![expect(clippy::unwrap_used, clippy::panic, reason = "tests fail by panicking")]

mod harness;

use harness::replays::{DRIVE, Watched, replay_settings, sha256_of};
use harness::{Bench, FREE, OCCUPIED, PgmMap, Run, map_sha256, recorded, text};
use messages::{SonarScan, Walkers};

const CORRIDOR: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/config/worlds/corridor-empty.toml");

/// The map frame begins where the robot does: at (0.9, 1.0) of the world.
const START_M: [f64; 2] = [0.9, 1.0];

#[test]
fn a_drive_ends_with_the_corridor_and_its_log_with_the_same_map() {
    let bench = Bench::new();
    let out = bench.path("out");
    let settings = bench.sonar_only(CORRIDOR);
    let drive = bench.output(["run", settings.to_str().unwrap(), "--speed", "30", "--out", out.to_str().unwrap()]);
    let driven = map_sha256(&drive);

    let map = PgmMap::read(&out);
    let wall = |from: [f64; 2], to: [f64; 2]| {
        map.wall_share([from[0] - START_M[0], from[1] - START_M[1]], [to[0] - START_M[0], to[1] - START_M[1]], 0.1)
    };
    assert!(wall([3.2, 0.0], [4.8, 0.0]) > 0.85, "the right wall between two doors");
    assert!(wall([7.8, 2.2], [9.5, 2.2]) > 0.85, "the left wall between two doors");
    assert!(wall([5.0, 0.0], [5.8, 0.0]) < 0.4, "an open door is no wall");
    let free = (20..100).filter(|step| map.at(f64::from(*step) * 0.1, 0.0) == FREE).count();
    assert!(free > 75, "{free} of 80 places along the robot's way are free");
    assert!(map.count(OCCUPIED) > 300);
    assert!(std::fs::metadata(out.join("map.png")).unwrap().len() > 2000);

    let log = out.join("drive.mcap");
    let info = bench.output(["log", "info", log.to_str().unwrap()]);
    assert_eq!(info.status.code(), Some(0), "{}", text(&info.stderr));
    assert!(text(&info.stdout).contains("robot/scan"), "{}", text(&info.stdout));
    for again in ["again", "and-again"] {
        let replay = bench.output(["replay", log.to_str().unwrap(), "--out", bench.path(again).to_str().unwrap()]);
        assert_eq!(map_sha256(&replay), driven, "{again}");
        assert_eq!(std::fs::read(out.join("map.pgm")).unwrap(), std::fs::read(bench.path(again).join("map.pgm")).unwrap());
    }
    assert_eq!(bench.left_behind(), Vec::<std::path::PathBuf>::new());
}

#[test]
fn a_replay_whose_verdicts_are_given_at_once_ends_and_tells_of_walkers_at_each_scan() {
    let (_, log, map) = &*DRIVE;
    let bench = Bench::new();
    let settings = replay_settings("replay", log, "").replace("[mapping]\n", "[mapping]\nhorizon_s = 0.0\n");
    let settings = bench.write("replay.toml", &settings);
    let ended = Watched::start(bench.stillmap(["run", settings.to_str().unwrap()])).end();
    assert_ne!(&sha256_of(&ended), map, "who walks is known less well without what comes later");
    let again = bench.path("replay-out").join("drive.mcap");
    let numbers = |all: Vec<(u64, Walkers)>| all.into_iter().map(|(seq, _)| seq).collect::<Vec<_>>();
    let scans: Vec<u64> = recorded::<SonarScan>(log).into_iter().map(|(seq, _)| seq).collect();
    assert_eq!(numbers(recorded(&again)), scans);
}

#[test]
fn a_running_deployment_tells_its_state_and_gives_its_map() {
    let bench = Bench::new();
    let run = Run::start(bench.stillmap(["demo", "--speed", "8", "--out", bench.path("out").to_str().unwrap()]));
    let mapping = bench.wait_for("mapping", "it has taken 100 scans", |process| process["received"].as_u64() > Some(100));
    assert_eq!(mapping["state"], "running");
    assert_eq!(mapping["lost"], 0);
    bench.remember_domain();
    let map = bench.output(["map", "--out", bench.path("now").to_str().unwrap()]);
    assert_eq!(map.status.code(), Some(0), "{}", text(&map.stderr));
    assert!(PgmMap::read(&bench.path("now")).count(FREE) > 300);
    let table = text(&bench.output(["status"]).stdout);
    for process in ["recorder", "mapping", "simulator", "pioneer"] {
        assert!(table.contains(process), "{table}");
    }

    let pid = rustix::process::Pid::from_raw(i32::try_from(run.pid()).unwrap()).unwrap();
    rustix::process::kill_process(pid, rustix::process::Signal::TERM).unwrap();
    let output = run.end();
    assert!(text(&output.stdout).contains("map sha256 "), "a run that is stopped ends with its map: {}", text(&output.stderr));
    assert_eq!(bench.left_behind(), Vec::<std::path::PathBuf>::new());
}
