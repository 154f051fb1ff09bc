//! Logs that become bags of ROS 2 and logs again, and pieces of logs.

use rustix::process::Signal;

use crate::harness::Sandbox;
use crate::harness::processes::signal;
use crate::harness::replay::{DRIVE, replay};

/// Runs a `log` command that succeeds.
fn log_command(sandbox: &Sandbox, arguments: &[&str]) {
    let ended = sandbox.output([&["log"], arguments].concat());
    ended.assert_code(0);
}

/// The log-odds differ in their last bits: ranges in a bag have single precision, and headings are quaternions.
#[test]
fn a_log_from_a_bag_of_a_log_gives_the_same_map() {
    let sandbox = Sandbox::new();
    let log = DRIVE.log(&sandbox);
    log_command(&sandbox, &["export", "--format", "ros2", log.to_str().unwrap(), "--out", "bag"]);
    log_command(&sandbox, &["import", "--format", "ros2", "bag", "--out", "again.mcap"]);
    sandbox.run(&replay("again", &sandbox.path("again.mcap")), &[]).end().map();
    let map = std::fs::read(sandbox.path("again-out").join("map.pgm")).unwrap();
    assert!(map == DRIVE.map_pgm, "the maps differ");
}

#[test]
fn pieces_of_a_log_that_are_merged_give_the_same_map() {
    let sandbox = Sandbox::new();
    let log = DRIVE.log(&sandbox);
    let log = log.to_str().unwrap();
    log_command(&sandbox, &["cut", log, "--to", "20", "--out", "early.mcap"]);
    log_command(&sandbox, &["cut", log, "--from", "10", "--out", "late.mcap"]);
    log_command(&sandbox, &["merge", "early.mcap", "late.mcap", "--out", "merged.mcap"]);
    log_command(&sandbox, &["filter", "merged.mcap", "--topics", "robot/scan,log/end", "--out", "scans.mcap"]);
    assert_eq!(sandbox.run(&replay("again", &sandbox.path("scans.mcap")), &[]).end().map(), DRIVE.map);
}

#[test]
fn a_log_is_replayed_with_other_settings() {
    let sandbox = Sandbox::new();
    let log = DRIVE.log(&sandbox);
    let coarse = replay("coarse", &log).set("mapping.cell_m", 0.1).write(&sandbox);
    let replayed = |settings: &[&str], out: &str| {
        let ended = sandbox.output([&["replay", log.to_str().unwrap(), "--out", out], settings].concat());
        ended.map();
        std::fs::read_to_string(sandbox.path(out).join("map.yaml")).unwrap()
    };
    assert!(replayed(&[], "as-recorded").contains("resolution: 0.05\n"));
    assert!(replayed(&["--settings", coarse.to_str().unwrap()], "coarser").contains("resolution: 0.1\n"));
}

#[test]
fn a_span_replays_as_the_piece_that_is_cut_of_it() {
    let sandbox = Sandbox::new();
    let log = DRIVE.log(&sandbox);
    let log = log.to_str().unwrap();
    log_command(&sandbox, &["cut", log, "--from", "5", "--to", "15", "--out", "piece.mcap"]);
    let of_the_piece = sandbox.output(["replay", "piece.mcap", "--out", "piece"]).map();
    assert_ne!(of_the_piece, DRIVE.map);
    assert_eq!(sandbox.output(["replay", log, "--from", "5", "--to", "15", "--out", "span"]).map(), of_the_piece);
    let beyond = sandbox.output(["replay", log, "--from", "100000", "--out", "beyond"]);
    beyond.assert_code(2);
}

#[test]
fn a_replay_in_a_loop_ends_when_it_is_stopped() {
    let sandbox = Sandbox::new();
    let log = DRIVE.log(&sandbox);
    let mut run = sandbox.start(sandbox.stillmap(["replay", log.to_str().unwrap(), "--to", "10", "--loop", "--out", "map"]));
    for _ in 0..2 {
        run.wait_for_line(" again");
    }
    // The third round has begun.
    run.wait_for_line("playing");
    signal(run.pid(), Signal::INT);
    let ended = run.end();
    ended.assert_code(0);
    let maps: Vec<&str> = ended.stdout.lines().filter(|line| line.starts_with("map sha256")).collect();
    assert!(maps.len() >= 2 && maps[0] == maps[1], "{maps:?}");
}
