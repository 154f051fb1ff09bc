//! kill -9 of every process of a replay in lockstep, at every kind of moment: the map is the same, byte for byte.
//!
//! Each moment is made, not waited for by luck: who is to be killed or who it waits for is stopped, or stands in the middle of a
//! file that is a pipe.
#![expect(clippy::unwrap_used, clippy::panic, reason = "tests fail by panicking")]

mod harness;

use std::path::{Path, PathBuf};
use std::sync::LazyLock;

use drivelog::{Entry, Log, Recording};
use harness::cork::Cork;
use harness::replays::{Watched, children, pid_of, sha256_of, try_kill, wait_until};
use harness::{Bench, recorded, signal};
use messages::{CameraFrame, CameraMotion, FilterVerdict, SonarMotion, SonarScan};
use rustix::process::Signal;

const WORLD: &str = include_str!("../config/worlds/corridor.toml");

/// What is the same in the recorded drive and in its replays.
const ROBOT: &str = "[robot]\nmodel = \"pioneer-1\"\nrange_limit_m = 3.0\nodometry_modulus = 32768\n";

/// One recorded drive for all tests, and what its undisturbed replay gives.
static DRIVE: LazyLock<(Bench, PathBuf, Outcome)> = LazyLock::new(|| {
    let bench = Bench::new();
    // Only the first of its ways, and not to its end: scans and pictures that the largest window holds.
    let (head, rest) = WORLD.split_once("[[robot.way]]").unwrap();
    let (way, rest) = rest.split_once("[[robot.way]]").unwrap();
    assert!(way.contains("to_m = [7.0,"), "{way}");
    let way = way.replace("to_m = [7.0,", "to_m = [6.0,");
    let world = bench.write("world.toml", &format!("{head}[[robot.way]]{way}{}", &rest[rest.find("[[wall]]").unwrap()..]));
    let processes = processes(&["recorder", "simulator", "pioneer"]);
    let settings = format!(
        "name = \"drive\"\nout = \"drive-out\"\n{processes}{ROBOT}[pioneer]\nport = \"simulator\"\n\
         [simulator]\nworld = {world:?}\n[simulator.camera]\nprovides = \"pictures\"\n"
    );
    let settings = bench.write("drive.toml", &settings);
    let driven = bench.output(["run", settings.to_str().unwrap(), "--speed", "5"]);
    assert_eq!(driven.status.code(), Some(0), "{}", harness::text(&driven.stderr));
    let log = bench.path("drive-out").join("drive.mcap");
    let undisturbed = Outcome::of(&bench, &replay(&bench, &log).end());
    assert!(undisturbed.motions.iter().any(|(_, it)| it.count > 0) && undisturbed.camera_motions.iter().any(|(_, it)| it.count > 0));
    assert!(undisturbed.verdicts.iter().any(|(_, it)| it.withheld > 0), "a lost verdict changes the map");
    (bench, log, undisturbed)
});

/// What comes of a replay: the map, and what was said and recorded on the way to it.
#[derive(PartialEq)]
struct Outcome {
    map: String,
    /// How many.
    scans: usize,
    pictures: usize,
    motions: Vec<(u64, SonarMotion)>,
    camera_motions: Vec<(u64, CameraMotion)>,
    verdicts: Vec<(u64, FilterVerdict)>,
}

impl Outcome {
    #[track_caller]
    fn of(bench: &Bench, ended: &(Option<i32>, String, String)) -> Self {
        let map = sha256_of(ended);
        let log = bench.path("replay-out").join("drive.mcap");
        let mut pictures = Log::open(&log).unwrap();
        let next = || matches!(pictures.next_picture::<CameraFrame>().unwrap(), Some(Entry::Message { .. })).then_some(());
        Self {
            map,
            scans: recorded::<SonarScan>(&log).len(),
            pictures: std::iter::from_fn(next).count(),
            motions: recorded(&log),
            camera_motions: recorded(&log),
            verdicts: recorded(&log),
        }
    }

    #[track_caller]
    fn assert_is(&self, expected: &Self, what: &str) {
        assert_eq!((self.scans, self.pictures), (expected.scans, expected.pictures), "{what}: scans and pictures recorded again");
        assert!(self.motions == expected.motions, "{what}: what moves as the sonars see it");
        assert!(self.camera_motions == expected.camera_motions, "{what}: what moves as the camera sees it");
        assert!(self.verdicts == expected.verdicts, "{what}: the verdicts");
        assert_eq!(self.map, expected.map, "{what}: the map");
    }
}

fn processes(kinds: &[&str]) -> String {
    kinds.iter().map(|kind| format!("[[process]]\nname = {kind:?}\nrun = {kind:?}\n")).collect()
}

/// A replay with every process that it can have.
fn replay(bench: &Bench, log: &Path) -> Watched {
    let injector = "[injector]\nservices = [\"robot/scan\", \"motion/sonar\", \"motion/camera\", \"map/verdict\"]\n";
    replay_with(bench, log, &["recorder", "mapping", "fti", "std", "sbs", "injector", "viewer", "playback"], 16, injector)
}

fn replay_with(bench: &Bench, log: &Path, kinds: &[&str], window: u64, more: &str) -> Watched {
    let processes = processes(kinds);
    let settings = format!(
        "name = \"replay\"\npace = \"lockstep\"\nout = \"replay-out\"\n{processes}{ROBOT}\
         [mapping]\nexpect_verdicts = true\nkeep_unfiltered = true\n[fti]\nexpect_camera = true\n[playback]\nlog = {log:?}\nwindow = {window}\n{more}\
         [supervisor]\nrestarts = 1000\nwithin_s = 1.0\nbackoff_first_s = 0.001\nbackoff_last_s = 0.01\n\
         startup_deadline_s = 60.0\nheartbeat_timeout_s = 60.0\nstop_deadline_s = 60.0\n"
    );
    let settings = bench.write("replay.toml", &settings);
    Watched::start(bench.stillmap(["run", settings.to_str().unwrap()]))
}

/// When a process is killed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Moment {
    /// As soon as it is there.
    Starting,
    /// Once everybody works.
    Steady,
    /// While messages wait for it that it has not taken.
    HoldingSamples,
    /// In the middle of writing a checkpoint, with a part of it in the file.
    WritingACheckpoint,
    /// When it has done its work.
    ShuttingDown,
}

const MOMENTS: [Moment; 5] = [Moment::Starting, Moment::Steady, Moment::HoldingSamples, Moment::WritingACheckpoint, Moment::ShuttingDown];

/// Replays the drive once for each moment, kills the process then, and compares the map.
#[track_caller]
fn leaves_the_map_as_it_is(process: &str) {
    let (_, log, undisturbed) = &*DRIVE;
    for moment in MOMENTS {
        // Whoever watches keeps nothing.
        if process == "viewer" && moment == Moment::WritingACheckpoint {
            continue;
        }
        let bench = Bench::new();
        let mut run = replay(&bench, log);
        let killed = match moment {
            Moment::Starting => try_kill(pid_of(&run, process)),
            Moment::Steady => {
                drop(run.wait_for_line("playback   is up"));
                try_kill(pid_of(&run, process))
            }
            Moment::HoldingSamples => kill_with_full_hands(&bench, &mut run, process),
            Moment::WritingACheckpoint => kill_in_the_middle_of_a_checkpoint(&bench, &mut run, process),
            Moment::ShuttingDown => kill_at_the_end(&bench, &mut run, process),
        };
        let ended = run.end_or(|| harness::text(&bench.output(["status", "--json"]).stdout));
        let mut found = Outcome::of(&bench, &ended);
        if process == "recorder" && moment == Moment::ShuttingDown {
            // Nobody waits for it to have what is computed anew from the scans and pictures that it has.
            found.motions.clone_from(&undisturbed.motions);
            found.camera_motions.clone_from(&undisturbed.camera_motions);
            found.verdicts.clone_from(&undisturbed.verdicts);
        }
        found.assert_is(undisturbed, &format!("{process} killed {moment:?}:\n{}\n", ended.2));
        // Those who end last may have ended by themselves.
        let may_be_gone = moment == Moment::ShuttingDown && ["recorder", "injector", "viewer"].contains(&process);
        assert!(killed || may_be_gone, "{process} was not there to be killed {moment:?}");
        assert!(may_be_gone || ended.1.contains(&format!("{process} once")), "{process} killed {moment:?}: {}", ended.1);
    }
}

/// Stops it when it works; lockstep stands when the window is full, and whoever does not read has messages waiting then.
fn kill_with_full_hands(bench: &Bench, run: &mut Watched, process: &str) -> bool {
    drop(run.wait_for_line("playback   is up"));
    let pid = pid_of(run, process);
    signal(pid, Signal::STOP);
    let played = |it: &serde_json::Value| process == "playback" || it["counters"]["scans played"].as_u64() > Some(0);
    drop(bench.wait_for("playback", "it has played", played));
    try_kill(pid)
}

fn kill_in_the_middle_of_a_checkpoint(bench: &Bench, run: &mut Watched, process: &str) -> bool {
    // The first process is up, the source of all messages is not.
    drop(run.wait_for_line("recorder   is up"));
    let small = ["recorder", "playback", "injector"].contains(&process);
    let cork = Cork::put(&bench.runtime().join(format!("replay/state/{process}.fresh")), small);
    let pid = pid_of(run, process);
    wait_until("a checkpoint is begun", || cork.holds(pid));
    // It must not start again before its file is as the kill left it.
    signal(run.pid().into(), Signal::STOP);
    let killed = try_kill(pid);
    cork.leave_what_was_written();
    signal(run.pid().into(), Signal::CONT);
    killed
}

/// While the supervisor is stopped nobody hears who is over: whoever is needed by others stays when it has done its work.
fn kill_at_the_end(bench: &Bench, run: &mut Watched, process: &str) -> bool {
    drop(run.wait_for_line("playback   is up"));
    match process {
        "mapping" => {
            let pid = pid_of(run, "mapping");
            let cork = Cork::put(&bench.path("replay-out").join(format!("map.{pid}.fresh")), false);
            wait_until("the map is being written", || cork.holds(pid));
            let killed = try_kill(pid);
            cork.leave_what_was_written();
            killed
        }
        "recorder" | "injector" | "viewer" => {
            drop(run.wait_for_line("playback   finished"));
            let there = children(run.pid()).into_iter().find(|(name, _)| name == process);
            there.is_some_and(|(_, pid)| try_kill(pid))
        }
        _ => {
            signal(run.pid().into(), Signal::STOP);
            wait_until("the map is finished", || children(run.pid()).iter().all(|(name, _)| name != "mapping"));
            let killed = try_kill(pid_of(run, process));
            signal(run.pid().into(), Signal::CONT);
            killed
        }
    }
}

#[test]
fn mapping_killed_at_any_moment() {
    leaves_the_map_as_it_is("mapping");
}

#[test]
fn std_killed_at_any_moment() {
    leaves_the_map_as_it_is("std");
}

#[test]
fn fti_killed_at_any_moment() {
    leaves_the_map_as_it_is("fti");
}

#[test]
fn sbs_killed_at_any_moment() {
    leaves_the_map_as_it_is("sbs");
}

#[test]
fn playback_killed_at_any_moment() {
    leaves_the_map_as_it_is("playback");
}

#[test]
fn recorder_killed_at_any_moment() {
    leaves_the_map_as_it_is("recorder");
}

#[test]
fn injector_killed_at_any_moment() {
    leaves_the_map_as_it_is("injector");
}

#[test]
fn viewer_killed_at_any_moment() {
    leaves_the_map_as_it_is("viewer");
}

const WITHOUT_AN_INJECTOR: [&str; 6] = ["recorder", "mapping", "fti", "std", "sbs", "playback"];

/// As [`killed_one_after_the_other`] in a replay of the drive.
#[track_caller]
fn one_killed_after_the_other(first: &str, second: &str, halted: &str) {
    let (_, log, undisturbed) = &*DRIVE;
    killed_one_after_the_other(log, undisturbed, first, second, halted);
}

/// While `halted` stands still the others come to the end of the log. Then `first` is killed, and `second` once the first is back:
/// it needs what the first has said before, which nobody computes again.
#[track_caller]
fn killed_one_after_the_other(log: &Path, undisturbed: &Outcome, first: &str, second: &str, halted: &str) {
    const WINDOW: u64 = 256;
    let scans = undisturbed.scans as u64;
    assert!(scans <= WINDOW, "{scans} scans");
    let bench = Bench::new();
    // An injector would keep what it carries beyond the death of who said it.
    let mut run = replay_with(&bench, log, &WITHOUT_AN_INJECTOR, WINDOW, "");
    // The source of all messages starts last.
    drop(run.wait_for_line(&format!("{halted:<10} is up")));
    let halted_pid = pid_of(&run, halted);
    signal(halted_pid, Signal::STOP);
    drop(bench.wait_for("playback", "it has played all", |it| it["counters"]["scans played"].as_u64() == Some(scans)));
    // FTI takes what the sonars see moving beside each scan; playback has said all.
    let least = match first {
        "fti" => 2 * scans,
        "playback" => 0,
        _ => scans,
    };
    drop(bench.wait_for(first, "it has had all", |it| it["received"].as_u64() >= Some(least)));
    assert!(try_kill(pid_of(&run, first)));
    drop(run.wait_for_line(&format!("{first:<10} is up again")));
    assert!(try_kill(pid_of(&run, second)));
    if halted != second {
        drop(run.wait_for_line(&format!("{second:<10} is up again")));
        signal(halted_pid, Signal::CONT);
    }
    let ended = run.end_or(|| harness::text(&bench.output(["status", "--json"]).stdout));
    let what = format!("{second} killed after {first}:\n{}\n", ended.2);
    Outcome::of(&bench, &ended).assert_is(undisturbed, &what);
    assert!(ended.1.contains(&format!("{first} once")) && ended.1.contains(&format!("{second} once")), "{}", ended.1);
}

#[test]
fn fti_killed_after_std() {
    one_killed_after_the_other("std", "fti", "fti");
}

#[test]
fn fti_killed_after_sbs() {
    one_killed_after_the_other("sbs", "fti", "fti");
}

#[test]
fn mapping_killed_after_fti() {
    one_killed_after_the_other("fti", "mapping", "mapping");
}

#[test]
fn playback_killed_after_std() {
    one_killed_after_the_other("std", "playback", "mapping");
}

#[test]
fn playback_killed_after_mapping() {
    one_killed_after_the_other("mapping", "playback", "fti");
}

/// The drive with numbers that leap in its middle by more than a stream's history, as they do where the disk was full.
fn write_with_a_gap(to: &Path) {
    const GAP: u64 = 1000;
    let (_, from, undisturbed) = &*DRIVE;
    let behind_a_gap = |seq: u64, count: usize| if seq > count as u64 / 2 { seq + GAP } else { seq };
    let mut log = Log::open(from).unwrap();
    let mut recording = Recording::new(log.preamble()).unwrap();
    while let Some(entry) = log.next_of::<SonarScan>().unwrap() {
        if let Entry::Message { seq, stamp_ns, payload } = entry {
            recording.scan(behind_a_gap(seq, undisturbed.scans), stamp_ns, &payload).unwrap();
        }
    }
    let mut log = Log::open(from).unwrap();
    while let Some(entry) = log.next_picture::<CameraFrame>().unwrap() {
        if let Entry::Message { seq, stamp_ns, payload } = entry {
            let seq = behind_a_gap(seq, undisturbed.pictures);
            recording.picture::<CameraFrame>(seq, stamp_ns, &payload.layout, &payload.bytes).unwrap();
        }
    }
    std::fs::write(to, recording.finish().unwrap()).unwrap();
}

#[test]
fn fti_killed_after_playback_of_a_log_with_a_gap() {
    let bench = Bench::new();
    let log = bench.path("gap.mcap");
    write_with_a_gap(&log);
    let undisturbed = Outcome::of(&bench, &replay_with(&bench, &log, &WITHOUT_AN_INJECTOR, 256, "").end());
    assert_eq!((undisturbed.scans, undisturbed.pictures), (DRIVE.2.scans, DRIVE.2.pictures));
    killed_one_after_the_other(&log, &undisturbed, "playback", "fti", "fti");
}
