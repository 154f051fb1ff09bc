//! People walk about, and the map is without them: STD, FTI and mapping together, also when one of them is killed.

use serde_json::Value;

use crate::harness::processes::kill;
use crate::harness::{Deployment, OCCUPIED, PgmMap, Run, Sandbox, is_running, worlds};

/// Starts the demo's deployment with patience: a busy machine changes nothing then, since the simulated world waits for SBS and no verdict
/// is given before all that it rests on has arrived.
fn start(sandbox: &Sandbox) -> Run {
    let demo = Deployment::demo().without("viewer");
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

/// The demo's drive in one process, where every stamp is the same each time. All ghosts are removed, for 6.43 % of the walls: the figure
/// may only improve.
#[test]
fn the_demo_removes_ghosts_and_keeps_walls() {
    let figures = swept(&Sandbox::new(), &[&world("hall"), "--seeds", "1..1"]);
    let share = |key: &str| figures[key].as_f64().unwrap_or_else(|| panic!("{key} in {figures}"));
    assert!(figures["ghosts_before"].as_u64() > Some(40), "{figures}");
    assert!(share("ghosts_removed") > 0.95 && share("walls_lost") < 0.065 && share("f1") > 0.7, "{figures}");
}

/// The map frame begins where the robot does: at (1.0, 2.2) of the hall.
const START_M: [f64; 2] = [1.0, 2.2];

/// A part of the hall's walls that a live drive loses at times.
struct KnownLoss {
    what: &'static str,
    centre_m: [f64; 2],
    radius_m: f64,
    /// Its share of the walls.
    share: f64,
}

/// What the filter loses of the walls beyond 3 %. The list may only get shorter, and its figures smaller.
const KNOWN_LOSSES: [KnownLoss; 1] = [
    // Measured in 16 live drives: lost in 6, while all other losses are 0.3 to 1.1 %. Whether it is taken for the walker that passes it
    // closely depends on milliseconds in the stamps of scans.
    KnownLoss { what: "the pillar on the right", centre_m: [9.0, 3.6], radius_m: 0.25, share: 0.082 },
];

impl KnownLoss {
    /// Whether no cell of it is in the map.
    fn is_in(&self, map: &PgmMap) -> bool {
        let reach_m = self.radius_m + 0.1;
        let steps = (reach_m / 0.025).ceil() as i32;
        let offsets = || (-steps..=steps).map(|step| f64::from(step) * 0.025);
        let around = offsets().flat_map(|dx| offsets().map(move |dy| [dx, dy])).filter(|[dx, dy]| dx.hypot(*dy) <= reach_m);
        let [x_m, y_m] = [0, 1].map(|axis| self.centre_m[axis] - START_M[axis]);
        !around.into_iter().any(|[dx, dy]| map.at(x_m + dx, y_m + dy) == OCCUPIED)
    }
}

#[test]
fn a_live_drive_removes_ghosts_and_replays_to_equal_maps() {
    let sandbox = Sandbox::new();
    start(&sandbox).end().map();
    let out = sandbox.path("demo-out");
    assert!(out.join("comparison.png").metadata().unwrap().len() > 10_000);
    let figures = evaluated(&sandbox);
    let share = |key: &str| figures[key].as_f64().unwrap_or_else(|| panic!("{key} in {figures}"));
    assert!(figures["ghosts_before"].as_u64() > Some(40), "{figures}");
    assert!(share("ghosts_removed") > 0.7 && share("f1") > 0.7, "{figures}");
    let map = PgmMap::read(&out);
    let known: Vec<&KnownLoss> = KNOWN_LOSSES.iter().filter(|known| known.is_in(&map)).collect();
    let elsewhere = share("walls_lost") - known.iter().map(|known| known.share).sum::<f64>();
    let what: Vec<&str> = known.iter().map(|known| known.what).collect();
    assert!(elsewhere < 0.03, "{elsewhere} of the walls lost beside {what:?}: {figures}");
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
