//! People walk about, and the map is without them: STD, FTI and mapping together, also when one of them is killed.

use serde_json::Value;

use crate::harness::processes::kill;
use crate::harness::{Deployment, Run, Sandbox, is_running, worlds};

/// Starts the demo's deployment with camera motion made from the truth and with patience: a busy machine changes nothing then, since no
/// picture is skipped and no verdict is given before all that it rests on has arrived.
fn start(sandbox: &Sandbox) -> Run {
    let demo = Deployment::demo().without("sbs").without("viewer").set("simulator.camera.provides", "motion");
    sandbox.run(&demo.set("fti.patience_s", 10), &["--speed", "4"])
}

#[track_caller]
fn evaluated(sandbox: &Sandbox) -> Value {
    let ended = sandbox.output(["evaluate", "demo-out", "--json"]);
    ended.assert_code(0);
    serde_json::from_str(&ended.stdout).unwrap()
}

#[track_caller]
fn swept(sandbox: &Sandbox, arguments: &[&str]) -> Value {
    let ended = sandbox.output([&["evaluate", "--json", "--world"], arguments].concat());
    ended.assert_code(0);
    serde_json::from_str(&ended.stdout).unwrap()
}

fn world(name: &str) -> String {
    worlds::path(name).to_str().unwrap().to_owned()
}

/// The demo's drive in one process, where every stamp is the same each time.
#[test]
fn the_demo_removes_ghosts_and_keeps_walls() {
    let figures = swept(&Sandbox::new(), &[&world("hall"), "--seeds", "1..1"]);
    let share = |key: &str| figures[key].as_f64().unwrap_or_else(|| panic!("{key} in {figures}"));
    assert!(figures["ghosts_before"].as_u64() > Some(40), "{figures}");
    assert!(share("ghosts_removed") > 0.7 && share("walls_lost") < 0.03 && share("f1") > 0.7, "{figures}");
}

/// More of the walls may be lost than in the drive above: whether the pillar that a walker passes closely is taken for the walker depends
/// on milliseconds in the stamps of scans.
#[test]
fn a_live_drive_removes_ghosts_and_replays_to_equal_maps() {
    let sandbox = Sandbox::new();
    start(&sandbox).end().map();
    let out = sandbox.path("demo-out");
    assert!(out.join("comparison.png").metadata().unwrap().len() > 10_000);
    let figures = evaluated(&sandbox);
    let share = |key: &str| figures[key].as_f64().unwrap_or_else(|| panic!("{key} in {figures}"));
    assert!(figures["ghosts_before"].as_u64() > Some(40), "{figures}");
    assert!(share("ghosts_removed") > 0.7 && share("walls_lost") < 0.1 && share("f1") > 0.7, "{figures}");
    assert_eq!(figures["runs"][0]["ghosts_removed"], figures["ghosts_removed"]);
    let log = out.join("drive.mcap");
    assert_eq!(sandbox.replayed(&log, "again"), sandbox.replayed(&log, "and-again"));
}

#[track_caller]
fn removes_ghosts_after_the_kill_of(process: &str) {
    let sandbox = Sandbox::new();
    let mut run = start(&sandbox);
    run.wait_for("mapping", "it has received 200 scans", |it| it.received > 200);
    kill(run.wait_for(process, "it runs", is_running).pid);
    run.wait_for(process, "it has restarted", |it| it.restarts == 1 && is_running(it));
    run.end().map();
    let removed = evaluated(&sandbox)["ghosts_removed"].as_f64();
    assert!(removed > Some(0.5), "{removed:?} of the ghosts removed");
}

#[test]
fn ghosts_are_removed_after_a_kill_of_std() {
    removes_ghosts_after_the_kill_of("std");
}

#[test]
fn ghosts_are_removed_after_a_kill_of_fti() {
    removes_ghosts_after_the_kill_of("fti");
}

#[test]
fn a_sweep_covers_every_seed_and_number_of_walkers() {
    let sandbox = Sandbox::new();
    let hall = world("hall");
    let report = swept(&sandbox, &[&hall, "--seeds", "1..2", "--walkers", "0,3"]);
    let runs: Vec<(u64, u64)> =
        report["runs"].as_array().unwrap().iter().map(|run| (run["walkers"].as_u64().unwrap(), run["seed"].as_u64().unwrap())).collect();
    assert_eq!(runs, [(0, 1), (0, 2), (3, 1), (3, 2)]);
    assert_eq!((report["runs"][0]["ghosts_before"].as_u64(), report["runs"][2]["ghosts_before"].as_u64() > Some(0)), (Some(0), true));
    let report = swept(&sandbox, &[&world("corridor-empty"), &hall, "--seeds", "1..1", "--walkers", "1,3"]);
    let walkers: Vec<_> = report["runs"].as_array().unwrap().iter().map(|run| run["walkers"].as_u64()).collect();
    assert_eq!(walkers, [Some(0), Some(1), Some(3)], "a world without walkers is driven once");
}

#[test]
fn a_sweep_of_an_unusable_world_is_refused_in_one_line() {
    let sandbox = Sandbox::new();
    let world = sandbox.write("world.toml", "[robot]\nstart_m = [0, 0]\nway = 7\n");
    let refused = sandbox.output(["evaluate", "--world", world.to_str().unwrap()]);
    refused.assert_code(2);
    assert_eq!(refused.stderr.lines().count(), 1, "{}", refused.stderr);
}
