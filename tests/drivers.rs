//! kill -9 of the robot's driver and of the robot itself, a simulated one, in a live drive, at every kind of moment, and of those that
//! read the scans when the driver has ended: the drive goes on to its end, what is lost on the way is marked, and the map is that of the
//! log, byte for byte.
//!
//! Each moment is made, not waited for by luck: who is to be killed or who it waits for is stopped, or stands in the middle of a
//! file that is a pipe.
#![expect(clippy::unwrap_used, clippy::panic, reason = "tests fail by panicking")]

mod harness;

use std::path::{Path, PathBuf};

use drivelog::{Entry, Log};
use harness::replays::{Watched, children, kill_in_the_middle_of_one_of_its_checkpoints, pid_of, sha256_of, wait_until};
use harness::{Bench, kill, map_sha256, signal};
use messages::{CameraFrame, SonarScan};
use rustix::process::Signal;
use serde_json::Value;
use settings::Settings;
use simulator::{Packet, Simulation, read_world};

const WORLD: &str = include_str!("../config/worlds/corridor-empty.toml");
/// Half a minute of robot's time passes in six seconds.
const SPEED: &str = "5";
/// Packets that wait on the line when whoever holds them is killed.
const WAITING: u64 = 20;
/// The robot's way from one packet to the next is no longer than this, m.
const STEP_M: f64 = 0.026;

/// When a process is killed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Moment {
    /// As soon as it is there.
    Starting,
    /// In mid-drive.
    Steady,
    /// While packets are on the line that the driver has not taken.
    HoldingSamples,
    /// In the middle of writing a checkpoint.
    WritingACheckpoint,
    /// When the robot has arrived: the driver once it is asked to stop, the simulator before its last packets are taken.
    ShuttingDown,
}

/// Drives down the first of the corridor's ways; the folder of the deployment is the runtime folder's `demo`.
struct Drive {
    bench: Bench,
    settings: PathBuf,
    run: Watched,
}

impl Drive {
    fn start(pictures: bool) -> Self {
        let bench = Bench::new();
        let (head, rest) = WORLD.split_once("[[robot.way]]").unwrap();
        let (way, rest) = rest.split_once("[[robot.way]]").unwrap();
        let world = bench.write("world.toml", &format!("{head}[[robot.way]]{way}{}", &rest[rest.find("[[wall]]").unwrap()..]));
        let text = std::fs::read_to_string(bench.sonar_only(world.to_str().unwrap())).unwrap();
        let text = if pictures { text.replace("provides = \"off\"", "provides = \"pictures\"") } else { text };
        let patience = "startup_deadline_s = 60\nheartbeat_timeout_s = 60\nstop_deadline_s = 60\n";
        let settings = bench.write("drive.toml", &format!("{text}\n[supervisor]\n{patience}"));
        bench.remember(&bench.runtime().join("demo"));
        let out = bench.path("out");
        let run = Watched::start(bench.stillmap(["run", settings.to_str().unwrap(), "--speed", SPEED, "--out", out.to_str().unwrap()]));
        Self { bench, settings, run }
    }

    fn pid(&self, process: &str) -> u64 {
        pid_of(&self.run, process)
    }

    /// What the robot says on this drive, whoever hears it.
    fn packets(&self) -> Vec<Packet> {
        let settings = Settings::read(&self.settings).unwrap();
        let world = read_world(&settings.simulator.world).unwrap();
        let mut drive = Simulation::new(&world, &stillmap::process::robot::body(&settings.robot), settings.simulator.seed.get().into());
        std::iter::from_fn(|| Some(drive.next_packet()?.0)).collect()
    }

    fn simulator(&self, what: &str, wanted: impl Fn(&Value) -> bool) -> Value {
        self.bench.wait_for("simulator", what, wanted)
    }

    /// Waits until scans are on their way to the map.
    fn goes(&self) {
        drop(self.bench.wait_for("mapping", "it has taken 50 scans", |it| it["received"].as_u64() > Some(50)));
    }

    /// Stops the driver, and waits until packets wait for it.
    fn fill_the_line(&self) {
        self.goes();
        signal(self.pid("pioneer"), Signal::STOP);
        let said = |it: &Value| it["counters"]["status packets"].as_u64();
        let before = said(&self.simulator("it counts", |it| said(it).is_some())).unwrap();
        drop(self.simulator("it goes on", |it| said(it) >= Some(before + WAITING)));
    }

    fn kill_in_the_middle_of_a_checkpoint(&self, process: &str) {
        self.goes();
        let fresh = self.bench.runtime().join(format!("demo/state/{process}.fresh"));
        kill_in_the_middle_of_one_of_its_checkpoints(&self.run, process, &fresh);
    }

    /// Kills the driver when it has had all of the drive and is asked to stop.
    fn kill_the_driver_at_the_end(&mut self) {
        self.goes();
        let (supervisor, pioneer) = (u64::from(self.run.pid()), self.pid("pioneer"));
        // Nobody asks it before it stands still.
        signal(supervisor, Signal::STOP);
        wait_until("the simulator is over", || children(self.run.pid()).iter().all(|(name, _)| name != "simulator"));
        signal(pioneer, Signal::STOP);
        signal(supervisor, Signal::CONT);
        drop(self.run.wait_for_line("the drive has ended"));
        kill(pioneer);
    }

    /// Kills one that reads the scans before it has taken the last of them, when their driver has nothing more to do.
    fn kill_a_reader_at_the_end(&mut self, reader: &str) {
        self.goes();
        let (supervisor, reader) = (u64::from(self.run.pid()), self.pid(reader));
        signal(supervisor, Signal::STOP);
        wait_until("the simulator is over", || children(self.run.pid()).iter().all(|(name, _)| name != "simulator"));
        signal(reader, Signal::STOP);
        signal(supervisor, Signal::CONT);
        let stays = |it: &Value| it["note"].as_str().is_some_and(|note| note.starts_with("has ended, stays for"));
        drop(self.bench.wait_for("pioneer", "it has said the end of the scans", stays));
        kill(reader);
    }

    fn kill_the_simulator_at_the_end(&self) {
        self.fill_the_line();
        drop(self.simulator("the robot has arrived", |it| it["note"] == "the robot has arrived"));
        self.take_the_line_away();
    }

    /// Kills the simulator, with which its end of the line goes, and lets the driver go on behind that.
    fn take_the_line_away(&self) {
        let pid = self.pid("simulator");
        kill(pid);
        let alive = || std::fs::read_to_string(format!("/proc/{pid}/stat")).is_ok_and(|it| !it.contains(") Z "));
        wait_until("it is dead", || !alive());
        signal(self.pid("pioneer"), Signal::CONT);
    }
}

/// The scans of a log with their stamps, which are numbered from 1 without a gap.
fn scans(log: &Path) -> Vec<(u64, SonarScan)> {
    let mut log = Log::open(log).unwrap();
    let mut scans = Vec::new();
    while let Some(entry) = log.next_of::<SonarScan>().unwrap() {
        if let Entry::Message { seq, stamp_ns, payload } = entry {
            scans.push((stamp_ns, payload));
            assert_eq!(seq, scans.len() as u64, "no number is missing, none comes twice");
        }
    }
    assert!(scans.windows(2).all(|pair| pair[0].0 < pair[1].0), "stamps grow");
    scans
}

fn is_of(scan: &SonarScan, packet: &Packet) -> bool {
    let readings = scan.readings().iter().zip(&packet.readings);
    scan.readings().len() == packet.readings.len() && { readings }
        .all(|(it, said)| it.sonar == u32::from(said.sonar) && (it.range_m - said.range_m.min(3.0)).abs() < 1e-6)
}

/// How the scans lie in the drive.
#[derive(Debug, Default)]
struct Found {
    /// Scans that are marked as coming after a gap.
    marked: usize,
    /// Packets that no scan is of, between scans and behind them.
    lost_between: usize,
    lost_behind: usize,
}

/// Each scan is of one packet, in order; where packets are missing there is a mark; and the pose goes on. A robot that is switched off
/// and on counts from zero: its way from the last packet that was heard to the next is not known then. Else all of its way is.
#[track_caller]
fn check_scans(scans: &[(u64, SonarScan)], packets: &[Packet], switched_off: bool) -> Found {
    let mut found = Found::default();
    let mut next = 0;
    let starts: Vec<usize> = (0..scans.len()).filter(|&at| at == 0 || scans[at].1.after_gap == 1).collect();
    for (&from, to) in starts.iter().zip(starts.iter().skip(1).copied().chain([scans.len()])) {
        let run = &scans[from..to];
        let fits = |at: &usize| run.iter().zip(&packets[*at..]).all(|((_, scan), packet)| is_of(scan, packet));
        let at = (next..=packets.len().saturating_sub(run.len())).find(fits);
        let at = at.unwrap_or_else(|| panic!("scans {} to {to} are no packets in a row after packet {next}", from + 1));
        if from > 0 {
            found.marked += 1;
            found.lost_between += at - next;
        }
        next = at + run.len();
        let off_m = 0.01 + if switched_off { (found.lost_between + found.marked) as f64 * STEP_M } else { 0.0 };
        for ((_, SonarScan { pose, .. }), Packet { odometry, number, .. }) in run.iter().zip(&packets[at..]) {
            let distance_m = (pose.x_m - odometry.x_m).hypot(pose.y_m - odometry.y_m);
            assert!(distance_m < off_m, "{pose:?} in packet {number}, expected {odometry:?} within {off_m} m");
        }
    }
    found.lost_behind = packets.len() - next;
    found
}

/// The numbers of the pictures in a log grow, and come to the end of the drive.
#[track_caller]
fn check_pictures(log: &Path, packets: &[Packet]) {
    let mut log = Log::open(log).unwrap();
    let mut last = (0, 0);
    while let Some(entry) = log.next_picture::<CameraFrame>().unwrap() {
        if let Entry::Message { seq, stamp_ns, .. } = entry {
            assert!(seq > last.0 && stamp_ns > last.1, "picture {seq} at {stamp_ns} ns after {last:?}");
            last = (seq, stamp_ns);
        }
    }
    // Three pictures in two packets.
    assert!(last.0 + 3 > packets.len() as u64 * 3 / 2, "{} pictures, {} packets", last.0, packets.len());
}

/// Drives once, kills the process then, and looks at what came of it.
#[track_caller]
fn goes_on(process: &str, moment: Moment) {
    let simulator = process == "simulator";
    let mut drive = Drive::start(simulator);
    match moment {
        Moment::Starting => kill(drive.pid(process)),
        Moment::Steady => {
            drive.goes();
            kill(drive.pid(process));
        }
        Moment::HoldingSamples => {
            drive.fill_the_line();
            if simulator { drive.take_the_line_away() } else { kill(drive.pid(process)) }
        }
        Moment::WritingACheckpoint => drive.kill_in_the_middle_of_a_checkpoint(process),
        Moment::ShuttingDown if simulator => drive.kill_the_simulator_at_the_end(),
        Moment::ShuttingDown => drive.kill_the_driver_at_the_end(),
    }
    let packets = drive.packets();
    let Drive { bench, run, .. } = drive;
    let ended = run.end_or(|| harness::text(&bench.output(["status", "--json"]).stdout));
    let driven = sha256_of(&ended);
    let restarted = ended.1.lines().find(|line| line.starts_with("restarted"));
    assert_eq!(restarted, Some(format!("restarted  {process} once").as_str()), "{}{}", ended.1, ended.2);
    assert_eq!(bench.left_behind(), Vec::<PathBuf>::new());

    let log = bench.path("out").join("drive.mcap");
    let found = check_scans(&scans(&log), &packets, simulator);
    let what = format!("{process} killed {moment:?}: {found:?}\n{}", ended.2);
    let in_mid_drive = ![Moment::Starting, Moment::ShuttingDown].contains(&moment);
    assert!(!in_mid_drive || found.marked > 0, "{what}");
    // What is on the line goes with the robot, and not with the driver.
    let waited = WAITING as usize;
    match (simulator, moment) {
        (true, Moment::HoldingSamples) => assert!(found.lost_between >= waited, "{what}"),
        (true, Moment::ShuttingDown) => assert!(found.lost_behind >= waited, "{what}"),
        (false, Moment::HoldingSamples) => assert!(found.lost_between < waited, "{what}"),
        // What it was about to say when it was killed.
        (false, Moment::WritingACheckpoint) => assert!(found.lost_between > 0, "{what}"),
        _ => {}
    }
    assert!(found.lost_behind == 0 || simulator && moment == Moment::ShuttingDown, "{what}");
    if simulator {
        check_pictures(&log, &packets);
    }
    let replayed = bench.output(["replay", log.to_str().unwrap(), "--out", bench.path("again").to_str().unwrap()]);
    assert_eq!(map_sha256(&replayed), driven, "{what}");
}

/// Live, what a reader lacks that is killed at the end can be had as long as the driver stays: the map is that of the log.
#[track_caller]
fn comes_to_the_end(reader: &str) {
    let mut drive = Drive::start(false);
    drive.kill_a_reader_at_the_end(reader);
    let Drive { bench, run, .. } = drive;
    let ended = run.end_or(|| harness::text(&bench.output(["status", "--json"]).stdout));
    let driven = sha256_of(&ended);
    let restarted = ended.1.lines().find(|line| line.starts_with("restarted"));
    assert_eq!(restarted, Some(format!("restarted  {reader} once").as_str()), "{}{}", ended.1, ended.2);
    let log = bench.path("out").join("drive.mcap");
    let replayed = bench.output(["replay", log.to_str().unwrap(), "--out", bench.path("again").to_str().unwrap()]);
    assert_eq!(map_sha256(&replayed), driven, "{}", ended.2);
}

#[test]
fn mapping_killed_when_the_driver_has_ended() {
    comes_to_the_end("mapping");
}

#[test]
fn std_killed_when_the_driver_has_ended() {
    comes_to_the_end("std");
}

#[test]
fn fti_killed_when_the_driver_has_ended() {
    comes_to_the_end("fti");
}

#[test]
fn driver_killed_when_it_starts() {
    goes_on("pioneer", Moment::Starting);
}

#[test]
fn driver_killed_in_mid_drive() {
    goes_on("pioneer", Moment::Steady);
}

#[test]
fn driver_killed_while_packets_wait_for_it() {
    goes_on("pioneer", Moment::HoldingSamples);
}

#[test]
fn driver_killed_while_it_writes_a_checkpoint() {
    goes_on("pioneer", Moment::WritingACheckpoint);
}

#[test]
fn driver_killed_when_it_is_asked_to_stop() {
    goes_on("pioneer", Moment::ShuttingDown);
}

#[test]
fn simulator_killed_when_it_starts() {
    goes_on("simulator", Moment::Starting);
}

#[test]
fn simulator_killed_in_mid_drive() {
    goes_on("simulator", Moment::Steady);
}

#[test]
fn simulator_killed_while_its_packets_are_not_taken() {
    goes_on("simulator", Moment::HoldingSamples);
}

#[test]
fn simulator_killed_while_it_writes_a_checkpoint() {
    goes_on("simulator", Moment::WritingACheckpoint);
}

#[test]
fn simulator_killed_when_the_robot_has_arrived() {
    goes_on("simulator", Moment::ShuttingDown);
}
