//! kill -9 of processes that a drive does not rest on: each comes back, the drive ends with its map, and nothing is left.
#![expect(clippy::unwrap_used, clippy::panic, reason = "tests fail by panicking")]

mod harness;

use std::path::Path;

use drivelog::{Ending, Entry, Log, Outcome, Preamble, Recording};
use harness::replays::{Watched, children, replay_settings, sha256_of};
use harness::{Bench, OCCUPIED, PgmMap, Run, kill, map_sha256, signal, text};
use messages::{Pose, SonarReading, SonarScan};
use rustix::process::Signal;

const CORRIDOR: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/config/worlds/corridor-empty.toml");

fn start(bench: &Bench) -> Run {
    let out = bench.path("out");
    let settings = bench.sonar_only(CORRIDOR);
    Run::start(bench.stillmap(["run", settings.to_str().unwrap(), "--speed", "10", "--out", out.to_str().unwrap()]))
}

#[track_caller]
fn survives_the_kill_of(process: &str, bench: &Bench) -> String {
    survives(Signal::KILL, process, bench).0
}

/// Sends the process a signal in mid-drive and looks at what came of it; the hash of the map, and what was said.
#[track_caller]
fn survives(deadly: Signal, process: &str, bench: &Bench) -> (String, String) {
    let run = start(bench);
    bench.wait_for("mapping", "it has taken 150 scans", |mapping| mapping["received"].as_u64() > Some(150));
    bench.remember_domain();
    let before = bench.wait_for(process, "it runs", |it| it["state"] == "running" && it["pid"].is_u64());
    signal(before["pid"].as_u64().unwrap(), deadly);
    let after = bench.wait_for(process, "it runs again", |it| it["restarts"] == 1 && it["state"] == "running");
    assert_ne!(after["pid"], before["pid"]);
    let ended = run.end();
    let driven = map_sha256(&ended);
    let map = PgmMap::read(&bench.path("out"));
    // The right wall before the kill and the left wall long after it, in the map frame.
    assert!(map.wall_share([2.3, -1.0], [3.9, -1.0], 0.1) > 0.8, "what was mapped before the kill is there");
    assert!(map.wall_share([6.9, 1.2], [8.6, 1.2], 0.1) > 0.8, "the drive went on after it");
    assert!(map.count(OCCUPIED) > 300);
    assert_eq!(bench.left_behind(), Vec::<std::path::PathBuf>::new());
    (driven, text(&ended.stderr))
}

#[test]
fn mapping_and_the_map_is_that_of_the_log() {
    let bench = Bench::new();
    let driven = survives_the_kill_of("mapping", &bench);
    assert_eq!(replayed(&bench), driven);
}

#[test]
fn mapping_that_somebody_tells_to_stop() {
    let bench = Bench::new();
    let (driven, said) = survives(Signal::TERM, "mapping", &bench);
    assert!(said.contains("was told to stop (SIGTERM), not by the supervisor; starts again"), "{said}");
    assert_eq!(replayed(&bench), driven);
}

#[test]
fn pioneer_that_somebody_interrupts_ends_no_stream() {
    let (_, said) = survives(Signal::INT, "pioneer", &Bench::new());
    assert!(said.contains("was told to stop (SIGINT), not by the supervisor; starts again"), "{said}");
}

#[test]
fn recorder_and_its_log_is_whole() {
    let bench = Bench::new();
    let driven = survives_the_kill_of("recorder", &bench);
    assert!(bench.path("out").join("drive.2.mcap").exists(), "the log goes on in a second part");
    assert_eq!(replayed(&bench), driven);
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
fn recorder_of_a_log_that_is_too_long_for_one_file() {
    const SCANS: u64 = 1500;
    let bench = Bench::new();
    let log = bench.path("long.mcap");
    write_log(&log, SCANS);
    // The recorder flushes each scan, since the next one comes only then: every one is a chunk.
    let settings = bench.write("long.toml", &replay_settings("long", &log, "").replace("window = 16", "window = 1"));
    let mut run = Watched::start(bench.stillmap(["run", settings.to_str().unwrap()]));
    let said = run.wait_for_line("recording continues in");
    assert!(said.contains("drive.2.mcap"), "{said}");
    let recorder = children(run.pid()).into_iter().find(|(name, _)| name == "recorder");
    kill(recorder.unwrap().1);
    let map = sha256_of(&run.end());

    let path = bench.path("long-out").join("drive.mcap");
    let mut again = Log::open(&path).unwrap();
    let mut scans = Vec::new();
    while let Some(entry) = again.next_of::<SonarScan>().unwrap() {
        scans.extend(if let Entry::Message { seq, .. } = entry { Some(seq) } else { None });
    }
    assert_eq!(scans, (1..=SCANS).collect::<Vec<_>>());
    let names: Vec<_> = again.parts().iter().map(|part| part.path.file_name().unwrap().to_str().unwrap()).collect();
    assert_eq!(names, ["drive.mcap", "drive.2.mcap", "drive.3.mcap"]);
    for whole in [&again.parts()[0], &again.parts()[2]] {
        assert_eq!(whole.outcome, Outcome::Read(Ending::Complete), "{whole:?}");
    }
    let settings = bench.write("again.toml", &replay_settings("again", &path, ""));
    assert_eq!(sha256_of(&Watched::start(bench.stillmap(["run", settings.to_str().unwrap()])).end()), map);
}

/// The hash of the map that the log gives.
fn replayed(bench: &Bench) -> String {
    let log = bench.path("out").join("drive.mcap");
    map_sha256(&bench.output(["replay", log.to_str().unwrap(), "--out", bench.path("again").to_str().unwrap()]))
}

#[test]
fn supervisor() {
    let bench = Bench::new();
    kill_the_supervisor(&bench, |_| ());
}

/// As a service manager removes it, which kills after that. The folder goes in one step: live processes write into it, and one that is
/// removed entry by entry may have a new entry when it is about to go itself.
#[test]
fn supervisor_whose_runtime_folder_is_gone() {
    let bench = Bench::new();
    kill_the_supervisor(&bench, |bench| {
        let aside = bench.path("removed");
        std::fs::rename(bench.runtime(), &aside).unwrap();
        std::fs::remove_dir_all(&aside).unwrap();
    });
}

/// Kills the supervisor in mid-drive, after something else, and waits for the end of its guard and its processes: nothing is left of the
/// deployment then.
#[track_caller]
fn kill_the_supervisor(bench: &Bench, before: impl Fn(&Bench)) {
    let run = start(bench);
    bench.wait_for("mapping", "it has taken 50 scans", |mapping| mapping["received"].as_u64() > Some(50));
    bench.remember_domain();
    let children = harness::exits_of_children(run.pid());
    assert!(children.len() > 5, "the guard and the processes: {}", children.len());
    before(bench);
    kill(run.pid().into());
    drop(run);
    children.iter().for_each(|child| harness::wait_for_exit(child));
    assert_eq!(bench.left_behind(), Vec::<std::path::PathBuf>::new());
}
