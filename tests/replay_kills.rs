//! kill -9 of every process of a replay in lockstep, at every kind of moment: the map is the same, byte for byte.
//!
//! Each moment is made, not hit by chance: the process to be killed, or one that it waits for, is stopped or blocked in the middle of
//! writing a file.

use std::path::{Path, PathBuf};
use std::sync::LazyLock;

use drivelog::{Entry, Log, Recording};
use messages::{CameraFrame, CameraMotion, FilterVerdict, RobotEstimate, SonarMotion, SonarScan, TrajectoryRevision};

use crate::harness::blocked_file::{BlockedFile, Room};
use crate::harness::processes::{Exit, kill, resume, stop};
use crate::harness::recorded_drive::RecordedDrive;
use crate::harness::{Deployment, Ended, Run, Sandbox, counter, recorded, worlds};

/// One recorded drive for all tests, and the results of its undisturbed replay.
static DRIVE: LazyLock<Drive> = LazyLock::new(|| {
    let sandbox = Sandbox::new();
    // Only the first leg, and not to its end: the largest window holds all scans and pictures.
    let mut world = worlds::read("corridor");
    let legs = worlds::legs(&mut world);
    legs.truncate(1);
    assert!(legs[0]["to_m"][0].as_float() > Some(6.0));
    legs[0]["to_m"][0] = toml::Value::from(6.0);
    let drive = with_robot(Deployment::new("drive", &["recorder", "simulator", "pioneer"])).set("pioneer.port", "simulator");
    let recorded = RecordedDrive::of(&drive.set("simulator.world", worlds::write(&sandbox, &world)), true);
    let undisturbed = Outcome::of(&sandbox, &replay(&sandbox, &recorded.write(&sandbox)).end());
    assert!(undisturbed.motions.iter().any(|(_, it)| it.count > 0) && undisturbed.camera_motions.iter().any(|(_, it)| it.count > 0));
    assert!(undisturbed.estimates.iter().any(|(_, it)| it.walls > 0), "poses follow from walls");
    assert!(undisturbed.verdicts.iter().any(|(_, it)| it.withheld > 0), "a lost verdict changes the map");
    Drive { recorded, undisturbed }
});

struct Drive {
    recorded: RecordedDrive,
    undisturbed: Outcome,
}

impl Drive {
    /// The file of the log in a sandbox.
    fn log(&self, sandbox: &Sandbox) -> PathBuf {
        self.recorded.write(sandbox)
    }
}

/// The results of a replay: the map, and what was recorded on the way to it.
struct Outcome {
    map: String,
    /// Numbers of recorded ones.
    scans: usize,
    pictures: usize,
    motions: Vec<(u64, SonarMotion)>,
    camera_motions: Vec<(u64, CameraMotion)>,
    verdicts: Vec<(u64, FilterVerdict)>,
    estimates: Vec<(u64, RobotEstimate)>,
    revisions: Vec<(u64, TrajectoryRevision)>,
}

impl Outcome {
    #[track_caller]
    fn of(sandbox: &Sandbox, ended: &Ended) -> Self {
        let map = ended.map();
        let log = sandbox.path("replay-out").join("drive.mcap");
        let mut pictures = Log::open(&log).unwrap();
        let next = || matches!(pictures.next_picture::<CameraFrame>().unwrap(), Some(Entry::Message { .. })).then_some(());
        Self {
            map,
            scans: recorded::<SonarScan>(&log).len(),
            pictures: std::iter::from_fn(next).count(),
            motions: recorded(&log),
            camera_motions: recorded(&log),
            verdicts: recorded(&log),
            estimates: recorded(&log),
            revisions: recorded(&log),
        }
    }

    #[track_caller]
    fn assert_equals(&self, expected: &Self, what: &str) {
        assert_eq!((self.scans, self.pictures), (expected.scans, expected.pictures), "{what}: recorded scans and pictures");
        assert!(self.motions == expected.motions, "{what}: motion seen by the sonars");
        assert!(self.camera_motions == expected.camera_motions, "{what}: motion seen by the camera");
        assert!(self.verdicts == expected.verdicts, "{what}: the verdicts");
        assert!(self.estimates == expected.estimates, "{what}: the estimates");
        assert!(self.revisions == expected.revisions, "{what}: the revisions");
        assert_eq!(self.map, expected.map, "{what}: the map");
    }
}

/// What the recorded drive and its replays have in common.
fn with_robot(deployment: Deployment) -> Deployment {
    deployment.set("robot.range_limit_m", 3.0).set("robot.odometry_modulus", 32768)
}

/// A replay of these processes.
fn deployment(log: &Path, programs: &[&str], window: u32) -> Deployment {
    let replay = with_robot(Deployment::new("replay", programs)).set("pace", "lockstep").tireless().patient();
    let replay = replay.set("mapping.keep_unfiltered", true);
    replay.set("playback.log", log).set("playback.window", window)
}

/// A replay with every process that it can have.
fn replay(sandbox: &Sandbox, log: &Path) -> Run {
    let all = deployment(log, &["recorder", "mapping", "fti", "std", "localisation", "sbs", "injector", "viewer", "playback"], 16);
    sandbox.run(&all.set("injector.services", ["robot/scan", "motion/sonar", "motion/camera", "map/verdict"]), &[])
}

/// When a process is killed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Moment {
    /// As soon as it exists.
    Starting,
    /// When all processes work.
    Steady,
    /// While messages wait for it that it has not taken.
    MessagesWaiting,
    /// In the middle of writing a checkpoint, with a part of it in the file.
    WritingCheckpoint,
    /// When it has done its work.
    Ending,
}

const MOMENTS: [Moment; 5] = [Moment::Starting, Moment::Steady, Moment::MessagesWaiting, Moment::WritingCheckpoint, Moment::Ending];

/// Replays the drive once for each moment, kills the process then, and compares the results.
#[track_caller]
fn kill_at_every_moment(process: &str) {
    for moment in MOMENTS {
        // The viewer saves no state.
        if process == "viewer" && moment == Moment::WritingCheckpoint {
            continue;
        }
        let sandbox = Sandbox::new();
        let mut run = replay(&sandbox, &DRIVE.log(&sandbox));
        match moment {
            Moment::Starting => kill(run.pid_of(process)),
            Moment::Steady => {
                let [mapping, pid] = hold(&mut run, process);
                resume(mapping);
                kill(pid);
            }
            Moment::MessagesWaiting => kill_with_messages_waiting(&mut run, process),
            Moment::WritingCheckpoint => kill_while_it_writes_a_checkpoint(&sandbox, &mut run, process),
            Moment::Ending => kill_at_the_end(&sandbox, &mut run, process),
        }
        let ended = run.end();
        let what = format!("{process} killed {moment:?}:\n{}\n", ended.stderr);
        Outcome::of(&sandbox, &ended).assert_equals(&DRIVE.undisturbed, &what);
        assert_eq!(ended.restarted(), Some(format!("{process} once").as_str()), "{what}");
    }
}

/// Stops mapping before the first scan is played, so that the replay comes no further than its window; the process ids of mapping and of
/// another process.
fn hold(run: &mut Run, process: &str) -> [u32; 2] {
    run.wait_for_line("mapping    is up");
    let mapping = run.pid_of("mapping");
    stop(mapping);
    run.wait_for_line("playback   is up");
    [mapping, run.pid_of(process)]
}

/// Stops it while it works: the others continue until the window is full, and messages wait for it then.
fn kill_with_messages_waiting(run: &mut Run, process: &str) {
    let [mapping, pid] = hold(run, process);
    stop(pid);
    if process != "mapping" {
        resume(mapping);
    }
    if process != "playback" {
        run.wait_for("playback", "it has played", |it| counter(it, "robot/scan played") > Some(0));
    }
    kill(pid);
}

fn kill_while_it_writes_a_checkpoint(sandbox: &Sandbox, run: &mut Run, process: &str) {
    // The first process is up, the source of all messages is not.
    run.wait_for_line("recorder   is up");
    let room = if ["recorder", "playback", "injector"].contains(&process) { Room::None } else { Room::Page };
    let file = BlockedFile::at(&sandbox.runtime().join(format!("replay/state/{process}.fresh")), room);
    let pid = run.pid_of(process);
    file.kill_writer(pid);
}

/// Mapping is killed while it writes the map. The others stay until the supervisor says that all have done their work, so they are
/// killed while it is stopped.
fn kill_at_the_end(sandbox: &Sandbox, run: &mut Run, process: &str) {
    let [mapping, pid] = hold(run, process);
    if process == "mapping" {
        let map = BlockedFile::at(&sandbox.path("replay-out").join(format!("map.{pid}.fresh")), Room::Page);
        resume(mapping);
        map.kill_writer(pid);
    } else {
        let end_of_mapping = Exit::of(mapping);
        stop(run.pid());
        resume(mapping);
        end_of_mapping.wait();
        kill(pid);
        resume(run.pid());
    }
}

#[test]
fn mapping_killed_at_any_moment_changes_nothing() {
    kill_at_every_moment("mapping");
}

#[test]
fn std_killed_at_any_moment_changes_nothing() {
    kill_at_every_moment("std");
}

#[test]
fn fti_killed_at_any_moment_changes_nothing() {
    kill_at_every_moment("fti");
}

#[test]
fn localisation_killed_at_any_moment_changes_nothing() {
    kill_at_every_moment("localisation");
}

#[test]
fn sbs_killed_at_any_moment_changes_nothing() {
    kill_at_every_moment("sbs");
}

#[test]
fn playback_killed_at_any_moment_changes_nothing() {
    kill_at_every_moment("playback");
}

#[test]
fn recorder_killed_at_any_moment_changes_nothing() {
    kill_at_every_moment("recorder");
}

#[test]
fn injector_killed_at_any_moment_changes_nothing() {
    kill_at_every_moment("injector");
}

#[test]
fn viewer_killed_at_any_moment_changes_nothing() {
    kill_at_every_moment("viewer");
}

/// An injector would keep the messages that it carries beyond the death of their sender.
const WITHOUT_INJECTOR: [&str; 7] = ["recorder", "mapping", "fti", "std", "localisation", "sbs", "playback"];

/// As [`kill_one_after_the_other_in`] in a replay of the drive.
#[track_caller]
fn kill_one_after_the_other(first: &str, second: &str, stopped: &str) {
    let sandbox = Sandbox::new();
    kill_one_after_the_other_in(&sandbox, &DRIVE.log(&sandbox), &DRIVE.undisturbed, first, second, stopped);
}

/// While `stopped` does not run the others come to the end of the log. Then `first` is killed, and `second` once the first has restarted:
/// it needs what the first published before, which is not computed again.
#[track_caller]
fn kill_one_after_the_other_in(sandbox: &Sandbox, log: &Path, undisturbed: &Outcome, first: &str, second: &str, stopped: &str) {
    const WINDOW: u32 = 256;
    let scans = undisturbed.scans as u64;
    assert!(scans <= WINDOW.into(), "{scans} scans");
    let mut run = sandbox.run(&deployment(log, &WITHOUT_INJECTOR, WINDOW), &[]);
    // Playback, the source of all messages, starts last.
    run.wait_for_line(&format!("{stopped:<10} is up"));
    let stopped_pid = run.pid_of(stopped);
    stop(stopped_pid);
    run.wait_for("playback", "it has played all", |it| counter(it, "robot/scan played") == Some(scans));
    // FTI receives the motion seen by the sonars beside each scan; playback has sent all.
    let least = match first {
        "fti" => 2 * scans,
        "playback" => 0,
        _ => scans,
    };
    kill(run.wait_for(first, "it has received all", |it| it.received >= least).pid);
    run.wait_for_line(&format!("{first:<10} is up again"));
    kill(run.pid_of(second));
    if stopped != second {
        run.wait_for_line(&format!("{second:<10} is up again"));
        resume(stopped_pid);
    }
    let ended = run.end();
    let what = format!("{second} killed after {first}:\n{}\n", ended.stderr);
    Outcome::of(sandbox, &ended).assert_equals(undisturbed, &what);
    let restarted = ended.restarted().unwrap_or_default();
    assert!([first, second].iter().all(|name| restarted.contains(&format!("{name} once"))), "{restarted}");
}

#[test]
fn fti_killed_after_std_changes_nothing() {
    kill_one_after_the_other("std", "fti", "fti");
}

#[test]
fn fti_killed_after_sbs_changes_nothing() {
    kill_one_after_the_other("sbs", "fti", "fti");
}

#[test]
fn mapping_killed_after_fti_changes_nothing() {
    kill_one_after_the_other("fti", "mapping", "mapping");
}

#[test]
fn playback_killed_after_std_changes_nothing() {
    kill_one_after_the_other("std", "playback", "mapping");
}

#[test]
fn playback_killed_after_mapping_changes_nothing() {
    kill_one_after_the_other("mapping", "playback", "fti");
}

/// The drive with numbers that jump in its middle by more than a stream's history, as they do where the disk was full.
fn write_with_a_gap(from: &Path, to: &Path) {
    const GAP: u64 = 1000;
    let undisturbed = &DRIVE.undisturbed;
    let after_the_gap = |seq: u64, count: usize| if seq > count as u64 / 2 { seq + GAP } else { seq };
    let mut log = Log::open(from).unwrap();
    let mut recording = Recording::new(log.preamble()).unwrap();
    while let Some(entry) = log.next_of::<SonarScan>().unwrap() {
        if let Entry::Message { seq, stamp_ns, payload } = entry {
            recording.scan(after_the_gap(seq, undisturbed.scans), stamp_ns, &payload).unwrap();
        }
    }
    let mut log = Log::open(from).unwrap();
    while let Some(entry) = log.next_picture::<CameraFrame>().unwrap() {
        if let Entry::Message { seq, stamp_ns, payload } = entry {
            let seq = after_the_gap(seq, undisturbed.pictures);
            recording.picture::<CameraFrame>(seq, stamp_ns, &payload.layout, &payload.bytes).unwrap();
        }
    }
    std::fs::write(to, recording.finish().unwrap()).unwrap();
}

#[test]
fn fti_killed_after_playback_of_a_gap_changes_nothing() {
    let sandbox = Sandbox::new();
    let log = sandbox.path("gap.mcap");
    write_with_a_gap(&DRIVE.log(&sandbox), &log);
    let undisturbed = Outcome::of(&sandbox, &sandbox.run(&deployment(&log, &WITHOUT_INJECTOR, 256), &[]).end());
    assert_eq!((undisturbed.scans, undisturbed.pictures), (DRIVE.undisturbed.scans, DRIVE.undisturbed.pictures));
    let killed = Sandbox::new();
    kill_one_after_the_other_in(&killed, &log, &undisturbed, "playback", "fti", "fti");
}
