//! People walk about, and the map is without them: std, fti and mapping together, and what becomes of it when one of them dies.
#![expect(clippy::unwrap_used, clippy::panic, reason = "tests fail by panicking")]

mod harness;

use harness::{Bench, Run, kill, map_sha256, text};
use serde_json::Value;

const DEMO: &str = include_str!("../config/demo.toml");
const HALL: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/config/worlds/hall.toml");

/// The demo's deployment, with camera motion made from the truth and with patience. What a busy machine delays changes nothing
/// then: no picture is skipped, and no verdict is given before everything is there that it rests on.
fn start(bench: &Bench) -> Run {
    let changes = [
        ("worlds/hall.toml", HALL),
        ("../demo-out", bench.path("out").to_str().unwrap()),
        ("provides = \"pictures\"", "provides = \"motion\""),
        ("expect_camera = true", "patience_s = 10\nexpect_camera = true"),
        ("[[process]]\nname = \"sbs\"          # what moves, as the camera sees it\nrun = \"sbs\"\n", ""),
        ("[[process]]\nname = \"viewer\"       # the live page for a browser; the run does not depend on it\nrun = \"viewer\"\n", ""),
    ]
    .map(|(from, to)| (from.to_owned(), to.to_owned()));
    let settings = changes.iter().fold(DEMO.to_owned(), |text, (from, to)| {
        assert!(text.contains(from.as_str()), "{from}");
        text.replacen(from.as_str(), to, 1)
    });
    let settings = bench.write("hall.toml", &settings);
    Run::start(bench.stillmap(["run", settings.to_str().unwrap(), "--speed", "4"]))
}

fn evaluated(bench: &Bench) -> Value {
    let output = bench.output(["evaluate", bench.path("out").to_str().unwrap(), "--json"]);
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    serde_json::from_slice(&output.stdout).unwrap()
}

/// The demo's drive in one process, where every stamp is the same each time.
#[test]
fn the_ghosts_of_the_demo_are_gone_and_its_walls_are_not() {
    let bench = Bench::new();
    let output = bench.output(["evaluate", "--world", HALL, "--seeds", "1..1", "--json"]);
    let figures: Value = serde_json::from_slice(&output.stdout).unwrap();
    let share = |key: &str| figures[key].as_f64().unwrap_or_else(|| panic!("{key} in {figures}"));
    assert!(figures["ghosts_before"].as_u64() > Some(40), "{figures}");
    assert!(share("ghosts_removed") > 0.7 && share("walls_lost") < 0.03 && share("f1") > 0.7, "{figures}");
}

/// Of the walls more may be gone than in the drive above: whether the pillar that a walker passes closely is taken for him hangs on
/// some milliseconds in the stamps of scans.
#[test]
fn the_ghosts_of_a_live_drive_are_gone_and_its_replays_are_equal() {
    let bench = Bench::new();
    let output = start(&bench).end();
    let driven = map_sha256(&output);
    assert!(bench.path("out").join("comparison.png").metadata().unwrap().len() > 10_000);
    let figures = evaluated(&bench);
    let share = |key: &str| figures[key].as_f64().unwrap_or_else(|| panic!("{key} in {figures}"));
    assert!(figures["ghosts_before"].as_u64() > Some(40), "{figures}");
    assert!(share("ghosts_removed") > 0.7 && share("walls_lost") < 0.1 && share("f1") > 0.7, "{figures}");
    assert_eq!(figures["runs"][0]["ghosts_removed"], figures["ghosts_removed"]);
    let replay = |out: &str| {
        let log = bench.path("out").join("drive.mcap");
        map_sha256(&bench.output(["replay", log.to_str().unwrap(), "--out", bench.path(out).to_str().unwrap()]))
    };
    assert_eq!(replay("again"), replay("and-again"));
    assert_eq!(driven.len(), 64);
}

#[track_caller]
fn filters_after_the_kill_of(process: &str) {
    let bench = Bench::new();
    let run = start(&bench);
    bench.wait_for("mapping", "it has taken 200 scans", |mapping| mapping["received"].as_u64() > Some(200));
    let before = bench.wait_for(process, "it runs", |it| it["state"] == "running" && it["pid"].is_u64());
    kill(before["pid"].as_u64().unwrap());
    bench.wait_for(process, "it runs again", |it| it["restarts"] == 1 && it["state"] == "running");
    map_sha256(&run.end());
    let removed = evaluated(&bench)["ghosts_removed"].as_f64();
    assert!(removed > Some(0.5), "{removed:?} of the ghosts removed");
}

#[test]
fn std_dies() {
    filters_after_the_kill_of("std");
}

#[test]
fn fti_dies() {
    filters_after_the_kill_of("fti");
}

#[test]
fn worlds_are_swept_and_what_is_none_is_refused() {
    let bench = Bench::new();
    let output = bench.output(["evaluate", "--world", HALL, "--seeds", "1..2", "--walkers", "0,3", "--json"]);
    let report: Value = serde_json::from_slice(&output.stdout).unwrap();
    let runs: Vec<(u64, u64)> =
        report["runs"].as_array().unwrap().iter().map(|run| (run["walkers"].as_u64().unwrap(), run["seed"].as_u64().unwrap())).collect();
    assert_eq!(runs, [(0, 1), (0, 2), (3, 1), (3, 2)]);
    assert_eq!((report["runs"][0]["ghosts_before"].as_u64(), report["runs"][2]["ghosts_before"].as_u64() > Some(0)), (Some(0), true));
    let nobody = HALL.replace("hall.toml", "corridor-empty.toml");
    let output = bench.output(["evaluate", "--world", &nobody, HALL, "--seeds", "1..1", "--walkers", "1,3", "--json"]);
    let report: Value = serde_json::from_slice(&output.stdout).unwrap();
    let walkers: Vec<_> = report["runs"].as_array().unwrap().iter().map(|run| run["walkers"].as_u64()).collect();
    assert_eq!(walkers, [Some(0), Some(1), Some(3)], "where nobody walks there is nobody to make more of");
    let world = bench.write("world.toml", "[robot]\nstart_m = [0, 0]\nway = 7\n");
    let refused = bench.output(["evaluate", "--world", world.to_str().unwrap()]);
    assert_eq!(refused.status.code(), Some(2));
    assert_eq!(text(&refused.stderr).lines().count(), 1, "{}", text(&refused.stderr));
}
