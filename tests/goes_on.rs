//! A deployment that is stopped or killed as a whole, and started again: its map goes on, unless somebody wants a new one.
#![expect(clippy::unwrap_used, clippy::panic, reason = "tests fail by panicking")]

mod harness;

use std::path::{Path, PathBuf};

use harness::replays::{children, try_kill};
use harness::{Bench, PgmMap, Run, map_sha256, recorded, text};
use messages::{FilterVerdict, Heartbeat, SonarScan};

/// Scans of the whole drive, and how many of them the first start must have taken before it ends.
const SCANS: usize = 500;
const BEFORE: u64 = 150;
/// Scans that the first start has in its checkpoints by then, at the least.
const KEPT: usize = 64;

/// A drive of 10 m along two walls, of which the driver says one line in 10 ms: `wall_m` is how far off the left one is on the
/// way of the first [`KEPT`] scans.
fn drive(bench: &Bench, wall_m: f64) -> PathBuf {
    let line = |k: usize| {
        let left = if k <= KEPT { wall_m } else { 1.3 };
        format!("{} {} 0 0  0 0.1 1.5707963 {left} 0 -0.1 -1.5707963 1.1\n", k as f64 * 0.1, k as f64 * 0.02)
    };
    bench.write("scans.txt", &(1..=SCANS).map(line).collect::<String>())
}

/// A deployment with a driver that begins its file anew at each start: who has had a scan drops it.
fn settings(bench: &Bench, name: &str, more: &str) -> PathBuf {
    let driver = Path::new(env!("CARGO_BIN_EXE_stillmap")).with_file_name("examples").join("text_driver");
    assert!(driver.exists(), "{} is missing: cargo build --release --example text_driver", driver.display());
    let scans = bench.path("scans.txt");
    let kinds = ["recorder", "mapping", "fti", "std"].map(|kind| format!("[[process]]\nname = {kind:?}\nrun = {kind:?}\n")).concat();
    bench.write(
        "own.toml",
        &format!(
            "name = {name:?}\nout = \"out\"\n{kinds}[[process]]\nname = \"driver\"\ncommand = [{driver:?}, {scans:?}]\nends_run = true\n\
             [fti]\nexpect_camera = false\npatience_s = 10\n[mapping]\nexpect_verdicts = true\n{more}"
        ),
    )
}

fn start(bench: &Bench, settings: &Path, words: &[&str]) -> Run {
    Run::start(bench.stillmap(["run", settings.to_str().unwrap()].iter().chain(words)))
}

/// The map of the whole drive, made in one go.
fn whole_map(wall_m: f64) -> String {
    let bench = Bench::new();
    drive(&bench, wall_m);
    map_sha256(&start(&bench, &settings(&bench, "own", ""), &[]).end())
}

/// Starts the deployment and ends it in the middle of the drive, in one of two ways.
fn first_start(bench: &Bench, settings: &Path, end: impl FnOnce(Run)) {
    let run = start(bench, settings, &[]);
    bench.wait_for("mapping", "it has taken some scans", |it| it["received"].as_u64() > Some(2 * BEFORE));
    end(run);
}

fn stop(run: Run) {
    harness::signal(run.pid().into(), rustix::process::Signal::TERM);
    map_sha256(&run.end());
}

/// Kills the supervisor, the guard and every process, the supervisor first so that nothing is in order any more.
fn kill_everything(run: Run) {
    let supervisor = run.pid();
    let listed = std::fs::read_to_string(format!("/proc/{supervisor}/task/{supervisor}/children")).unwrap();
    assert_eq!(children(supervisor).len(), 4);
    harness::kill(supervisor.into());
    for pid in listed.split_ascii_whitespace() {
        try_kill(pid.parse().unwrap());
    }
    drop(run);
}

/// Whatever the driver now says of the first scans, the map has them already, and is that of the drive in one go.
#[track_caller]
fn goes_on_after(end: impl FnOnce(Run)) {
    let bench = Bench::new();
    drive(&bench, 1.3);
    let settings = settings(&bench, "own", "");
    first_start(&bench, &settings, end);
    drive(&bench, 0.6);
    let second = start(&bench, &settings, &[]).end();
    assert!(text(&second.stderr).contains("the last run goes on"), "{}", text(&second.stderr));
    assert_eq!(map_sha256(&second), whole_map(1.3), "{}", text(&second.stderr));
    let out = bench.path("out");
    assert!(out.join("drive.2.mcap").exists(), "the log goes on in its next part");
    assert!(!out.join("state-1").exists() && !text(&second.stderr).contains("kept as"), "{}", text(&second.stderr));
    // All of the drive is in the log.
    let replayed = bench.output(["replay", out.join("drive.mcap").to_str().unwrap(), "--out", bench.path("again").to_str().unwrap()]);
    assert_eq!(map_sha256(&replayed), map_sha256(&second));
}

#[test]
fn a_map_goes_on_after_everything_was_killed() {
    goes_on_after(kill_everything);
}

#[test]
fn a_map_goes_on_after_a_stop_and_a_fresh_one_does_not() {
    let bench = Bench::new();
    drive(&bench, 1.3);
    let settings = settings(&bench, "own", "");
    first_start(&bench, &settings, stop);
    let first = PgmMap::read(&bench.path("out"));
    drive(&bench, 0.6);
    let second = start(&bench, &settings, &[]).end();
    map_sha256(&second);
    let (map, out) = (PgmMap::read(&bench.path("out")), bench.path("out"));
    assert!(map.wall_share([0.1, 1.4], [1.2, 1.4], 0.1) > 0.8, "the wall of the first start is there");
    assert!(map.wall_share([0.1, 0.7], [1.2, 0.7], 0.1) < 0.2, "and nothing is drawn into it");
    assert!(map.width > first.width + 20, "and the drive goes on");
    assert!(!out.join("state-1").exists());
    // What had ended with the first start goes on, too.
    let log = out.join("drive.mcap");
    assert!(numbers::<SonarScan>(&log).eq(1..=SCANS as u64), "every scan is in the log");
    assert!(numbers::<FilterVerdict>(&log).eq(1..=SCANS as u64), "and has its verdict");

    // Everything is as after the first start of all.
    let fresh = start(&bench, &settings, &["--fresh"]).end();
    assert!(text(&fresh.stderr).contains("a new run begins: that was asked for"), "{}", text(&fresh.stderr));
    assert_eq!(map_sha256(&fresh), whole_map(0.6));
    assert!(out.join("state-1/mapping.checkpoint").exists(), "the state before is kept");
    assert!(!out.join("drive.2.mcap").exists(), "the log is a new one");
}

#[test]
fn what_cannot_be_gone_on_from_is_put_aside_as_a_whole() {
    let bench = Bench::new();
    drive(&bench, 1.3);
    let own = settings(&bench, "own", "");
    map_sha256(&start(&bench, &own, &[]).end());
    drive(&bench, 0.6);
    let anew = whole_map(0.6);
    let state = bench.path("out").join("state");

    let path = state.join("std.checkpoint");
    let mut bytes = std::fs::read(&path).unwrap();
    *bytes.last_mut().unwrap() ^= 1;
    std::fs::write(&path, &bytes).unwrap();
    let damaged = start(&bench, &own, &[]).end();
    assert!(
        text(&damaged.stderr).contains("std.checkpoint is no checkpoint of the last one (at byte 24: checksum"),
        "{}",
        text(&damaged.stderr)
    );
    assert!(text(&damaged.stderr).contains("state-1"), "{}", text(&damaged.stderr));
    assert_eq!(map_sha256(&damaged), anew);

    let other = settings(&bench, "other", "");
    let foreign = start(&bench, &other, &[]).end();
    assert!(text(&foreign.stderr).contains("the last one was of deployment own"), "{}", text(&foreign.stderr));
    assert_eq!(map_sha256(&foreign), anew);

    let coarser = settings(&bench, "other", "cell_m = 0.1\n");
    let otherwise = start(&bench, &coarser, &[]).end();
    assert!(text(&otherwise.stderr).contains("other settings of [robot] or [mapping]"), "{}", text(&otherwise.stderr));
    map_sha256(&otherwise);
    assert!((1..=3).all(|times| bench.path("out").join(format!("state-{times}/mapping.checkpoint")).exists()));
}

fn numbers<T: drivelog::Logged>(log: &Path) -> impl Iterator<Item = u64> {
    recorded::<T>(log).into_iter().map(|(seq, _)| seq)
}

/// Scans that mapping was told of more than once, as its last heartbeat in the log has it.
fn repeated_scans(log: &Path) -> u64 {
    let heartbeats = recorded::<Heartbeat>(log);
    let (_, last) = heartbeats.iter().rfind(|(_, it)| it.process.as_str() == "mapping").unwrap();
    last.inputs.iter().find(|input| input.service.as_str() == "robot/scan").unwrap().repeated
}

#[test]
fn a_robot_goes_on_with_its_numbers_and_a_simulated_deployment_begins_anew() {
    let world = concat!(env!("CARGO_MANIFEST_DIR"), "/config/worlds/corridor-empty.toml");
    let bench = Bench::new();
    // The robot is another deployment's simulator: it stays switched on while the one under test is stopped.
    let simulator = format!(
        "name = \"world\"\nout = \"world\"\n[robot]\nmodel = \"pioneer-1\"\nodometry_modulus = 32768\n[simulator]\nworld = {world:?}\n\
         [supervisor]\nstartup_deadline_s = 600\n[[process]]\nname = \"simulator\"\nrun = \"simulator\"\n\
         [[process]]\nname = \"nobody\"\ncommand = [\"sleep\", \"600\"]\n"
    );
    let simulator = bench.write("world.toml", &simulator);
    let world = Run::start(bench.stillmap(["run", simulator.to_str().unwrap(), "--speed", "2"]));
    let port = bench.runtime().join("world/robot");
    let began = std::time::Instant::now();
    while !port.exists() {
        assert!(began.elapsed().as_secs() < 60, "the simulated robot has no port");
        std::thread::yield_now();
    }
    let robot = format!(
        "name = \"robot\"\nout = \"out\"\n[robot]\nmodel = \"pioneer-1\"\nodometry_modulus = 32768\n[pioneer]\nport = {:?}\n{}",
        port.to_str().unwrap(),
        ["recorder", "mapping", "pioneer"].map(|kind| format!("[[process]]\nname = {kind:?}\nrun = {kind:?}\n")).concat()
    );
    let robot = bench.write("robot.toml", &robot);
    let scans = |words: &[&str]| {
        let run = Run::start(bench.stillmap(["run", robot.to_str().unwrap(), "--speed", "2"].iter().chain(words)));
        bench.wait_for("mapping", "it has taken scans", |it| it["received"].as_u64() > Some(60));
        harness::signal(run.pid().into(), rustix::process::Signal::TERM);
        let ended = run.end();
        map_sha256(&ended);
        let stdout = text(&ended.stdout);
        let figures = stdout.lines().find_map(|line| line.strip_prefix("figures    ")).unwrap_or_else(|| panic!("{stdout}")).to_owned();
        figures.split(' ').next().unwrap().parse::<u64>().unwrap()
    };
    let (first, second) = (scans(&[]), scans(&[]));
    assert!(second > first + 60, "{second} scans after {first}: they are numbered on, and the map has them all");
    let out = bench.path("out");
    assert!(out.join("drive.2.mcap").exists() && !out.join("state-1").exists());
    // The driver has said its last scan again, in case nobody had it, and gone on behind it.
    let log = out.join("drive.mcap");
    assert_eq!(repeated_scans(&log), 1);
    assert_eq!(recorded::<SonarScan>(&log).len() as u64, second);
    scans(&["--fresh"]);
    assert!(!out.join("drive.2.mcap").exists() && out.join("state-1").exists());
    harness::signal(world.pid().into(), rustix::process::Signal::TERM);
    drop(world.end());
    assert!(!bench.path("world").join("state").exists(), "a simulated robot keeps nothing");
}
