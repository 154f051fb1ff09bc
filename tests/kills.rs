//! kill -9 of processes that a drive can lose: each restarts, the drive ends with its map, and nothing is left.

use std::path::Path;

use drivelog::{Ending, Log, Outcome, Preamble, Recording};
use messages::{Pose, SonarReading, SonarScan};
use rustix::process::Signal;

use crate::harness::processes::{Exit, kill, signal};
use crate::harness::{Deployment, Ended, OCCUPIED, PgmMap, Run, Sandbox, is_running, recorded, replay, worlds};

fn start(sandbox: &Sandbox) -> Run {
    sandbox.run(&Deployment::sonar_only(worlds::path("corridor-empty")), &["--speed", "4"])
}

/// Sends the process a signal in mid-drive and checks the map.
#[track_caller]
fn drive_with(process: &str, deadly: Signal, sandbox: &Sandbox) -> Ended {
    let mut run = start(sandbox);
    run.wait_for("mapping", "it has received 150 scans", |it| it.received > 150);
    let before = run.wait_for(process, "it runs", is_running);
    signal(before.pid, deadly);
    let after = run.wait_for(process, "it has restarted", |it| it.restarts == 1 && is_running(it));
    assert_ne!(after.pid, before.pid);
    let ended = run.end();
    ended.assert_code(0);
    let map = PgmMap::read(&sandbox.path("demo-out"));
    // The right wall before the signal and the left wall long after it, in the map frame.
    assert!(map.wall_share([2.3, -1.0], [3.9, -1.0], 0.1) > 0.8, "the wall mapped before the signal");
    assert!(map.wall_share([6.9, 1.2], [8.6, 1.2], 0.1) > 0.8, "the wall mapped after it");
    assert!(map.count(OCCUPIED) > 300);
    sandbox.assert_nothing_left();
    ended
}

/// The hash of the map that the log gives.
#[track_caller]
fn replayed(sandbox: &Sandbox) -> String {
    sandbox.replayed(&sandbox.path("demo-out").join("drive.mcap"), "again")
}

#[test]
fn a_killed_mapping_resumes_with_the_map_of_the_log() {
    let sandbox = Sandbox::new();
    let ended = drive_with("mapping", Signal::KILL, &sandbox);
    assert_eq!(replayed(&sandbox), ended.map());
}

#[test]
fn a_mapping_terminated_by_a_stranger_restarts() {
    let sandbox = Sandbox::new();
    let ended = drive_with("mapping", Signal::TERM, &sandbox);
    assert!(ended.stderr.contains("was told to stop (SIGTERM), not by the supervisor; starts again"), "{}", ended.stderr);
    assert_eq!(replayed(&sandbox), ended.map());
}

#[test]
fn a_driver_interrupted_by_a_stranger_restarts() {
    let ended = drive_with("pioneer", Signal::INT, &Sandbox::new());
    assert!(ended.stderr.contains("was told to stop (SIGINT), not by the supervisor; starts again"), "{}", ended.stderr);
}

#[test]
fn a_killed_recorder_continues_the_log_in_a_second_part() {
    let sandbox = Sandbox::new();
    let ended = drive_with("recorder", Signal::KILL, &sandbox);
    assert!(sandbox.path("demo-out").join("drive.2.mcap").exists());
    assert_eq!(replayed(&sandbox), ended.map());
}

/// A drive along a wall, of so many scans, as a log.
fn write_log(path: &Path, scans: u64) {
    let preamble =
        Preamble { run: 1, robot: "pioneer-1".into(), sonars: vec![Pose::default()], origin: "a test".into(), settings: String::new() };
    let mut recording = Recording::new(&preamble).unwrap();
    for seq in 1..=scans {
        let wall =
            SonarReading { mount: Pose { yaw_rad: std::f64::consts::FRAC_PI_2, ..Pose::default() }, range_m: 1.0, sonar: 0, echo: 1 };
        let scan = SonarScan::new(Pose { x_m: seq as f64 * 0.01, ..Pose::default() }, &[wall], false);
        recording.scan(seq, seq * 100_000_000, &scan).unwrap();
    }
    recording.end::<SonarScan>(scans, scans * 100_000_000).unwrap();
    std::fs::write(path, recording.finish().unwrap()).unwrap();
}

#[test]
fn a_recorder_killed_after_its_first_file_loses_no_scan() {
    const SCANS: u64 = 1500;
    let sandbox = Sandbox::new();
    let log = sandbox.path("long.mcap");
    write_log(&log, SCANS);
    // With one scan on the way each scan is flushed, and each flush is a chunk: the file has all the chunks that it can hold.
    let mut run = sandbox.run(&replay::replay("long", &log).set("playback.window", 1), &[]);
    let said = run.wait_for_line("recording continues in");
    assert!(said.contains("drive.2.mcap"), "{said}");
    kill(run.pid_of("recorder"));
    let map = run.end().map();

    let path = sandbox.path("long-out").join("drive.mcap");
    let scans: Vec<u64> = recorded::<SonarScan>(&path).into_iter().map(|(seq, _)| seq).collect();
    assert_eq!(scans, (1..=SCANS).collect::<Vec<_>>());
    let mut again = Log::open(&path).unwrap();
    while again.next_of::<SonarScan>().unwrap().is_some() {}
    let names: Vec<_> = again.parts().iter().map(|part| part.path.file_name().unwrap().to_str().unwrap()).collect();
    assert_eq!(names, ["drive.mcap", "drive.2.mcap", "drive.3.mcap"]);
    for complete in [&again.parts()[0], &again.parts()[2]] {
        assert_eq!(complete.outcome, Outcome::Read(Ending::Complete), "{complete:?}");
    }
    assert_eq!(sandbox.run(&replay::replay("again", &path), &[]).end().map(), map);
}

#[test]
fn a_killed_supervisor_leaves_nothing() {
    let sandbox = Sandbox::new();
    kill_the_supervisor(&sandbox, || ());
}

/// As a service manager does it that removes the folder before it kills. The folder goes in one step: live processes write into it, and
/// one that is removed entry by entry may have a new entry when it is about to go itself.
#[test]
fn a_supervisor_killed_without_runtime_folder_leaves_nothing() {
    let sandbox = Sandbox::new();
    kill_the_supervisor(&sandbox, || {
        let aside = sandbox.path("removed");
        std::fs::rename(sandbox.runtime(), &aside).unwrap();
        std::fs::remove_dir_all(&aside).unwrap();
    });
}

/// Kills the supervisor in mid-drive, after something else, and waits for the exits of its guard and its processes.
#[track_caller]
fn kill_the_supervisor(sandbox: &Sandbox, before: impl Fn()) {
    let mut run = start(sandbox);
    run.wait_for("mapping", "it has received 50 scans", |it| it.received > 50);
    let children = Exit::of_children(run.pid());
    assert_eq!(children.len(), 7, "six processes and the guard");
    before();
    kill(run.pid());
    children.iter().for_each(Exit::wait);
    sandbox.assert_nothing_left();
    assert_eq!(run.end().code, None, "killed");
}
