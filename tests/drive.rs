//! A simulated drive from serial bytes to a map, and the same map from its log.

use messages::{SonarScan, Walkers};
use rustix::process::Signal;

use crate::harness::processes::signal;
use crate::harness::replay::DRIVE;
use crate::harness::{Deployment, FREE, OCCUPIED, PgmMap, Sandbox, is_running, recorded, worlds};

/// The map frame begins where the robot does: at (0.9, 1.0) of the world.
const START_M: [f64; 2] = [0.9, 1.0];

#[test]
fn a_drive_maps_the_corridor_and_replays_give_the_same_map() {
    let sandbox = Sandbox::new();
    let driven = sandbox.run(&Deployment::sonar_only(worlds::path("corridor-empty")), &["--speed", "6"]).end().map();
    let out = sandbox.path("demo-out");

    let map = PgmMap::read(&out);
    let wall = |from: [f64; 2], to: [f64; 2]| {
        map.wall_share([from[0] - START_M[0], from[1] - START_M[1]], [to[0] - START_M[0], to[1] - START_M[1]], 0.1)
    };
    assert!(wall([3.2, 0.0], [4.8, 0.0]) > 0.85, "the right wall between two doors");
    assert!(wall([7.8, 2.2], [9.5, 2.2]) > 0.85, "the left wall between two doors");
    assert!(wall([5.0, 0.0], [5.8, 0.0]) < 0.4, "an open door is no wall");
    let free = (20..100).filter(|step| map.at(f64::from(*step) * 0.1, 0.0) == FREE).count();
    assert!(free > 75, "{free} of 80 cells along the robot's path are free");
    assert!(map.count(OCCUPIED) > 300);
    assert!(std::fs::metadata(out.join("map.png")).unwrap().len() > 2000);

    let log = out.join("drive.mcap");
    let info = sandbox.output(["log", "info", log.to_str().unwrap()]);
    info.assert_code(0);
    assert!(info.stdout.contains("robot/scan"), "{}", info.stdout);
    for again in ["again", "and-again"] {
        assert_eq!(sandbox.replayed(&log, again), driven, "{again}");
        assert_eq!(std::fs::read(out.join("map.pgm")).unwrap(), std::fs::read(sandbox.path(again).join("map.pgm")).unwrap());
    }
    sandbox.assert_nothing_left();
}

#[test]
fn without_a_horizon_walkers_are_published_for_each_scan() {
    let sandbox = Sandbox::new();
    let replay = DRIVE.replay(&sandbox, "replay");
    let ended = sandbox.run(&replay.set("mapping.horizon_s", 0.0), &[]).end();
    assert_ne!(ended.map(), DRIVE.map, "walkers are known less well without the scans that come later");
    let numbers = |all: Vec<(u64, Walkers)>| all.into_iter().map(|(seq, _)| seq).collect::<Vec<_>>();
    let scans: Vec<u64> = recorded::<SonarScan>(&DRIVE.log(&sandbox)).into_iter().map(|(seq, _)| seq).collect();
    assert_eq!(numbers(recorded(&sandbox.path("replay-out").join("drive.mcap"))), scans);
}

#[test]
fn a_running_deployment_reports_its_status_and_exports_its_map() {
    let sandbox = Sandbox::new();
    let mut run = sandbox.start(sandbox.stillmap(["demo", "--speed", "4"]));
    let mapping = run.wait_for("mapping", "it has received 100 scans", |it| it.received > 100);
    assert!(is_running(&mapping) && mapping.lost == 0, "{mapping:?}");
    sandbox.output(["map", "--out", "now"]).assert_code(0);
    assert!(PgmMap::read(&sandbox.path("now")).count(FREE) > 300);
    let table = sandbox.output(["status"]).stdout;
    let json: serde_json::Value = serde_json::from_str(&sandbox.output(["status", "--json"]).stdout).unwrap();
    for process in ["recorder", "mapping", "simulator", "pioneer"] {
        assert!(table.contains(process), "{table}");
        assert!(json[0]["processes"].as_array().unwrap().iter().any(|it| it["process"] == process), "{json}");
    }

    signal(run.pid(), Signal::TERM);
    // A run that is stopped ends with its map.
    run.end().map();
    sandbox.assert_nothing_left();
}
