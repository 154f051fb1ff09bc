//! A deployment that is stopped or killed as a whole and started again: its map is resumed, unless a fresh one is asked for.

use std::path::{Path, PathBuf};

use messages::{FilterVerdict, Heartbeat, SonarScan};
use rustix::fs::inotify::WatchFlags;
use rustix::process::Signal;

use crate::harness::inotify::Inotify;
use crate::harness::processes::{children, kill, signal, try_kill};
use crate::harness::{Deployment, PgmMap, Run, Sandbox, recorded, worlds};
use crate::own_driver::text_driver;

/// Scans of the whole drive, and messages that mapping must have received in the first start before that ends: two for each of 150 scans.
const SCANS: usize = 500;
const FIRST_START: u64 = 300;
/// Scans that are certainly in the checkpoints of the first start by then.
const SAVED: usize = 64;

/// A drive of 10 m along two walls, of which the driver publishes one line in 10 ms: `wall_m` is how far the left one is from the path of
/// the first [`SAVED`] scans.
fn write_scans(sandbox: &Sandbox, wall_m: f64) -> PathBuf {
    let line = |k: usize| {
        let left = if k <= SAVED { wall_m } else { 1.3 };
        format!("{} {} 0 0  0 0.1 1.5707963 {left} 0 -0.1 -1.5707963 1.1\n", k as f64 * 0.1, k as f64 * 0.02)
    };
    sandbox.write("scans.txt", &(1..=SCANS).map(line).collect::<String>())
}

/// A deployment whose driver reads its file from the beginning at each start; scans that were already received are dropped.
fn deployment(name: &str, sandbox: &Sandbox) -> Deployment {
    let own = Deployment::new(name, &["recorder", "mapping", "fti", "std"]).with_driver([text_driver(), sandbox.path("scans.txt")]);
    own.set("out", "out").set("fti.patience_s", 10)
}

/// The map of the whole drive, made in one go.
fn whole_map(wall_m: f64) -> String {
    let sandbox = Sandbox::new();
    write_scans(&sandbox, wall_m);
    sandbox.run(&deployment("own", &sandbox), &[]).end().map()
}

/// Starts the deployment and ends it in the middle of the drive, in one of two ways.
fn first_start(sandbox: &Sandbox, deployment: &Deployment, end: impl FnOnce(Run)) {
    let mut run = sandbox.run(deployment, &[]);
    run.wait_for("mapping", "it has received some scans", |it| it.received > FIRST_START);
    end(run);
}

fn stop(run: Run) {
    signal(run.pid(), Signal::TERM);
    run.end().map();
}

/// Kills the supervisor, the guard and every process, the supervisor first so that nothing is put in order any more.
fn kill_everything(run: Run) {
    let all = children(run.pid());
    assert_eq!(all.len(), 6, "five processes and the guard");
    kill(run.pid());
    for pid in all {
        try_kill(pid);
    }
    assert_eq!(run.end().code, None, "killed");
}

#[test]
fn a_deployment_killed_as_a_whole_resumes_its_map() {
    let sandbox = Sandbox::new();
    write_scans(&sandbox, 1.3);
    let own = deployment("own", &sandbox);
    first_start(&sandbox, &own, kill_everything);
    // The map holds the first scans already: what the driver now publishes under their numbers is dropped.
    write_scans(&sandbox, 0.6);
    let second = sandbox.run(&own, &[]).end();
    assert!(second.stderr.contains("the last run is resumed"), "{}", second.stderr);
    assert_eq!(second.map(), whole_map(1.3), "{}", second.stderr);
    let out = sandbox.path("out");
    assert!(out.join("drive.2.mcap").exists(), "the log is continued in its next part");
    assert!(!out.join("state-1").exists() && !second.stderr.contains("kept as"), "{}", second.stderr);
    assert_eq!(sandbox.replayed(&out.join("drive.mcap"), "again"), second.map(), "all of the drive is in the log");
}

/// What a power cut leaves: the boot is another one, and files that were replaced since the last sync are empty.
fn cut_the_power(state: &Path) {
    std::fs::write(state.join("running"), "the id of another boot\n").unwrap();
    for name in ["mapping.checkpoint", "fti.checkpoint", "run"] {
        // Another file than the one in the set.
        std::fs::remove_file(state.join(name)).unwrap();
        std::fs::write(state.join(name), [0; 4096]).unwrap();
    }
}

#[test]
fn a_power_cut_resumes_the_checkpoints_of_the_last_sync() {
    let sandbox = Sandbox::new();
    write_scans(&sandbox, 1.3);
    let own = deployment("own", &sandbox).set("supervisor.sync_s", 1);
    let state = sandbox.path("out").join("state");
    first_start(&sandbox, &own, |run| {
        // The sets alternate: when the next one is made, the one before is on the disk.
        let has_map =
            |set: &str| std::fs::read_to_string(state.join(set).join("list")).is_ok_and(|list| list.contains(" mapping.checkpoint"));
        Inotify::watch(&state, WatchFlags::CREATE).wait_until("a set with a map", || has_map("set-0") || has_map("set-1"));
        kill_everything(run);
    });
    cut_the_power(&state);
    // The first scans are in the map of the set: what the driver now publishes under their numbers is dropped.
    write_scans(&sandbox, 0.6);
    let second = sandbox.run(&own, &[]).end();
    for line in ["the last run is resumed", "the computer stopped while the last run was running: up to 1 s before that"] {
        assert!(second.stderr.contains(line), "{}", second.stderr);
    }
    assert_eq!(second.map(), whole_map(1.3), "{}", second.stderr);
    assert!(!sandbox.path("out").join("state-1").exists() && !state.join("running").exists());
}

#[test]
fn a_power_cut_before_the_first_sync_begins_a_new_run() {
    let sandbox = Sandbox::new();
    write_scans(&sandbox, 1.3);
    let own = deployment("own", &sandbox).set("supervisor.sync_s", 3600);
    first_start(&sandbox, &own, kill_everything);
    cut_the_power(&sandbox.path("out").join("state"));
    write_scans(&sandbox, 0.6);
    let second = sandbox.run(&own, &[]).end();
    let reason = "a new run begins: the computer stopped before a state of the last one was on the disk";
    assert!(second.stderr.contains(reason), "{}", second.stderr);
    assert_eq!(second.map(), whole_map(0.6));
}

#[test]
fn a_stopped_deployment_resumes_its_map_unless_started_fresh() {
    let sandbox = Sandbox::new();
    write_scans(&sandbox, 1.3);
    let own = deployment("own", &sandbox);
    first_start(&sandbox, &own, stop);
    let first = PgmMap::read(&sandbox.path("out"));
    write_scans(&sandbox, 0.6);
    sandbox.run(&own, &[]).end().map();
    let (map, out) = (PgmMap::read(&sandbox.path("out")), sandbox.path("out"));
    assert!(map.wall_share([0.1, 1.4], [1.2, 1.4], 0.1) > 0.8, "the wall of the first start");
    assert!(map.wall_share([0.1, 0.7], [1.2, 0.7], 0.1) < 0.2, "the first scans are not integrated again");
    assert!(map.width > first.width + 20, "the drive continues");
    assert!(!out.join("state-1").exists());
    // Streams that ended with the first start are resumed, too.
    let log = out.join("drive.mcap");
    assert!(numbers::<SonarScan>(&log).eq(1..=SCANS as u64), "every scan is in the log");
    assert!(numbers::<FilterVerdict>(&log).eq(1..=SCANS as u64), "and has its verdict");

    let fresh = sandbox.run(&own, &["--fresh"]).end();
    assert!(fresh.stderr.contains("a new run begins: that was asked for"), "{}", fresh.stderr);
    assert_eq!(fresh.map(), whole_map(0.6));
    assert!(out.join("state-1/mapping.checkpoint").exists(), "the state before is set aside");
    assert!(!out.join("drive.2.mcap").exists(), "the log is a new one");
}

#[test]
fn a_state_that_does_not_fit_is_set_aside_as_a_whole() {
    let sandbox = Sandbox::new();
    write_scans(&sandbox, 1.3);
    let own = deployment("own", &sandbox);
    sandbox.run(&own, &[]).end().map();
    write_scans(&sandbox, 0.6);
    let fresh = whole_map(0.6);

    let path = sandbox.path("out").join("state/std.checkpoint");
    let mut bytes = std::fs::read(&path).unwrap();
    *bytes.last_mut().unwrap() ^= 1;
    std::fs::write(&path, &bytes).unwrap();
    let damaged = sandbox.run(&own, &[]).end();
    let reason = "std.checkpoint is no checkpoint of the last one (at byte 24: checksum";
    assert!(damaged.stderr.contains(reason) && damaged.stderr.contains("state-1"), "{}", damaged.stderr);
    assert_eq!(damaged.map(), fresh);

    let other = deployment("other", &sandbox);
    let foreign = sandbox.run(&other, &[]).end();
    assert!(foreign.stderr.contains("the last one was of deployment own"), "{}", foreign.stderr);
    assert_eq!(foreign.map(), fresh);

    let coarser = sandbox.run(&other.set("mapping.cell_m", 0.1), &[]).end();
    assert!(coarser.stderr.contains("other settings of [robot] or [mapping]"), "{}", coarser.stderr);
    coarser.map();
    assert!((1..=3).all(|times| sandbox.path("out").join(format!("state-{times}/mapping.checkpoint")).exists()));
}

/// The numbers of a service's messages in a log.
fn numbers<T: drivelog::Logged>(log: &Path) -> impl Iterator<Item = u64> {
    recorded::<T>(log).into_iter().map(|(seq, _)| seq)
}

/// Scans that mapping received more than once, by its last heartbeat in the log.
fn repeated_scans(log: &Path) -> u64 {
    let heartbeats = recorded::<Heartbeat>(log);
    let (_, last) = heartbeats.iter().rfind(|(_, it)| it.process.as_str() == "mapping").unwrap();
    last.inputs.iter().find(|input| input.service.as_str() == "robot/scan").unwrap().repeated
}

/// A simulated robot with a serial line of its own that stays switched on while the deployment under test is stopped or killed: the
/// simulator of another deployment. The process beside it keeps that one from ending for lack of a driver.
pub(crate) fn robot_of_its_own(sandbox: &Sandbox, speed: &str) -> Run {
    let world = Deployment::new("world", &["simulator"]).set("simulator.world", worlds::path("corridor-empty"));
    let world = world.set("robot.odometry_modulus", 32768).with_driver(["sleep", "100000"]).set("supervisor.startup_deadline_s", 600);
    let mut run = sandbox.run(&world, &["--speed", speed]);
    run.wait_for_line("simulator  is up");
    let port = robot_port(sandbox);
    Inotify::watch(port.parent().unwrap(), WatchFlags::CREATE | WatchFlags::MOVED_TO).wait_until("the robot's port", || port.exists());
    run
}

/// The port of that robot.
pub(crate) fn robot_port(sandbox: &Sandbox) -> PathBuf {
    sandbox.runtime().join("world/robot")
}

#[test]
fn a_real_robots_scans_are_numbered_on_after_a_restart() {
    let sandbox = Sandbox::new();
    let world = robot_of_its_own(&sandbox, "2");
    let robot = Deployment::new("robot", &["recorder", "mapping", "pioneer"]).set("robot.odometry_modulus", 32768);
    let robot = robot.set("pioneer.port", robot_port(&sandbox));
    let scans = |words: &[&str]| {
        let mut run = sandbox.run(&robot, &[&["--speed", "2"], words].concat());
        run.wait_for("mapping", "it has received scans", |it| it.received > 60);
        signal(run.pid(), Signal::TERM);
        let ended = run.end();
        ended.map();
        let figures = ended.stdout.lines().find_map(|line| line.strip_prefix("figures    ")).unwrap();
        figures.split(' ').next().unwrap().parse::<u64>().unwrap()
    };
    let (first, second) = (scans(&[]), scans(&[]));
    assert!(second > first + 60, "{second} scans after {first}: the map has those of both starts");
    let out = sandbox.path("robot-out");
    assert!(out.join("drive.2.mcap").exists() && !out.join("state-1").exists());
    // The driver publishes its last scan again, in case no process received it, and continues after it.
    let log = out.join("drive.mcap");
    assert_eq!(repeated_scans(&log), 1);
    assert_eq!(recorded::<SonarScan>(&log).len() as u64, second);
    scans(&["--fresh"]);
    assert!(!out.join("drive.2.mcap").exists() && out.join("state-1").exists());
    signal(world.pid(), Signal::TERM);
    world.end();
    assert!(!sandbox.path("world-out").join("state").exists(), "a simulated robot saves no state");
}
