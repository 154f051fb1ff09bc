//! kill -9 of the robot's driver and of the simulated robot in a live drive, at every kind of moment, and of the processes that read the
//! scans when the driver has ended: the drive continues to its end, what is lost on the way is marked, and the map is that of the log,
//! byte for byte.
//!
//! Each moment is made, not hit by chance: the process to be killed, or one that it waits for, is stopped or blocked in the middle of
//! writing a file.

use std::path::Path;

use drivelog::{Entry, Log};
use messages::{CameraFrame, ProcessStatus, SonarScan};
use settings::Settings;
use simulator::{Packet, Simulation};

use crate::harness::blocked_file::BlockedFile;
use crate::harness::processes::{Exit, kill, resume, stop};
use crate::harness::{Deployment, Ended, Run, Sandbox, counter, worlds};

/// Half a minute of robot time passes in fourteen seconds. A robot closes its line to a client that is silent for two seconds of its time,
/// and a busy machine must not keep the driver from its work that long.
const SPEED: &str = "2";
/// Packets that wait on the line when their reader is killed.
const WAITING: u64 = 20;
/// The robot's path from one packet to the next is no longer than this, m.
const STEP_M: f64 = 0.026;

/// When a process is killed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Moment {
    /// As soon as it exists.
    Starting,
    /// In mid-drive.
    Steady,
    /// While packets are on the line that the driver has not taken.
    PacketsWaiting,
    /// In the middle of writing a checkpoint.
    WritingCheckpoint,
    /// When the robot has arrived: the driver once it is asked to stop, the simulator before its last packets are taken.
    Ending,
}

/// A drive along the first leg of the corridor.
struct Drive {
    sandbox: Sandbox,
    deployment: Deployment,
    run: Run,
}

impl Drive {
    /// Starts it, with a robot that waits for its driver or, as a real one, does not.
    fn start(pictures: bool, waits: bool) -> Self {
        let sandbox = Sandbox::new();
        let mut world = worlds::read("corridor-empty");
        worlds::legs(&mut world).truncate(1);
        let drive = Deployment::sonar_only(worlds::write(&sandbox, &world)).patient();
        let drive = if pictures { drive.set("simulator.camera.provides", "pictures") } else { drive };
        // The world does not wait for a driver that is connected by path.
        let drive = if waits { drive } else { drive.set("pioneer.port", sandbox.runtime().join("demo/robot")) };
        let run = sandbox.run(&drive, &["--speed", SPEED]);
        Self { sandbox, deployment: drive, run }
    }

    /// The packets that the robot sends on this drive, received or not.
    fn packets(&self) -> Vec<Packet> {
        let settings = Settings::parse("demo.toml", &self.deployment.to_toml()).unwrap();
        let world = world_file::read(&settings.simulator.world).unwrap();
        let mut drive = Simulation::new(&world, &stillmap::process::robot::body(&settings.robot), settings.simulator.seed.get().into());
        std::iter::from_fn(|| Some(drive.next_packet()?.0)).collect()
    }

    fn wait_for_scans(&mut self) {
        self.run.wait_for("mapping", "it has received 50 scans", |it| it.received > 50);
    }

    /// Stops the driver, and waits until packets wait for it.
    fn fill_the_line(&mut self) {
        self.wait_for_scans();
        stop(self.run.pid_of("pioneer"));
        let sent = |it: &ProcessStatus| counter(it, "status packets");
        let before = sent(&self.run.wait_for("simulator", "it counts packets", |it| sent(it).is_some())).unwrap();
        self.run.wait_for("simulator", "20 more packets", |it| sent(it) >= Some(before + WAITING));
    }

    fn kill_while_it_writes_a_checkpoint(&mut self, process: &str) {
        self.wait_for_scans();
        let pid = self.run.pid_of(process);
        let file = BlockedFile::at_checkpoint(&self.sandbox.runtime().join("demo/state"), process);
        file.kill_writer(pid);
    }

    /// Stops a process when the robot has arrived and the simulator has exited, before the supervisor asks the driver to stop.
    fn stop_at_the_end(&mut self, process: &str) -> u32 {
        self.wait_for_scans();
        let simulator = Exit::of(self.run.pid_of("simulator"));
        let pid = self.run.pid_of(process);
        stop(self.run.pid());
        simulator.wait();
        stop(pid);
        resume(self.run.pid());
        pid
    }

    fn kill_the_driver_at_the_end(&mut self) {
        let pioneer = self.stop_at_the_end("pioneer");
        self.run.wait_for_line("the drive has ended");
        kill(pioneer);
    }

    /// Kills a reader of the scans that has not received the last of them, when the driver has nothing more to send.
    fn kill_a_reader_at_the_end(&mut self, reader: &str) {
        let reader = self.stop_at_the_end(reader);
        let stays = |it: &ProcessStatus| it.note.as_str().starts_with("has ended, stays for");
        self.run.wait_for("pioneer", "it has sent the end of the scans", stays);
        kill(reader);
    }

    fn kill_the_simulator_at_the_end(&mut self) {
        self.fill_the_line();
        self.run.wait_for("simulator", "the robot has arrived", |it| it.note.as_str() == "the robot has arrived");
        self.take_the_line_away();
    }

    /// Kills the simulator, and its end of the line with it, and lets the driver continue after that.
    fn take_the_line_away(&mut self) {
        let simulator = self.run.pid_of("simulator");
        let exit = Exit::of(simulator);
        kill(simulator);
        exit.wait();
        resume(self.run.pid_of("pioneer"));
    }

    /// Its end: one process has restarted once, and the log gives the same map. The folder of outputs.
    #[track_caller]
    fn end(self, restarted: &str) -> (Sandbox, Ended) {
        let ended = self.run.end();
        assert_eq!(ended.restarted(), Some(format!("{restarted} once").as_str()), "{}", ended.stderr);
        self.sandbox.assert_nothing_left();
        let replayed = self.sandbox.replayed(&self.sandbox.path("demo-out").join("drive.mcap"), "again");
        assert_eq!(ended.map(), replayed, "{}", ended.stderr);
        (self.sandbox, ended)
    }
}

/// The scans of a log with their stamps; they are numbered from 1 without a gap.
fn scans(log: &Path) -> Vec<(u64, SonarScan)> {
    let mut log = Log::open(log).unwrap();
    let mut scans = Vec::new();
    while let Some(entry) = log.next_of::<SonarScan>().unwrap() {
        if let Entry::Message { seq, stamp_ns, payload } = entry {
            scans.push((stamp_ns, payload));
            assert_eq!(seq, scans.len() as u64, "numbers follow each other");
        }
    }
    assert!(scans.windows(2).all(|pair| pair[0].0 < pair[1].0), "stamps increase");
    scans
}

fn was_made_of(scan: &SonarScan, packet: &Packet) -> bool {
    let readings = scan.readings().iter().zip(&packet.readings);
    scan.readings().len() == packet.readings.len() && { readings }
        .all(|(it, said)| it.sonar == u32::from(said.sonar) && (it.range_m - said.range_m.min(3.0)).abs() < 1e-6)
}

/// Which packets of the drive have become scans.
#[derive(Debug, Default)]
struct Coverage {
    /// Scans that are marked as coming after a gap.
    marked: usize,
    /// Packets without a scan, between scans and after the last.
    lost_between: usize,
    lost_after: usize,
}

/// Each scan is of one packet, in order; where packets are missing there is a mark; and the pose is continuous. A robot that is switched
/// off and on counts from zero: its path from the last packet that was received to the next is unknown then. Otherwise all of its path is
/// known.
#[track_caller]
fn check_scans(scans: &[(u64, SonarScan)], packets: &[Packet], switched_off: bool, said: &str) -> Coverage {
    let mut found = Coverage::default();
    let mut next = 0;
    let starts: Vec<usize> = (0..scans.len()).filter(|&at| at == 0 || scans[at].1.after_gap > 0).collect();
    for (&from, to) in starts.iter().zip(starts.iter().skip(1).copied().chain([scans.len()])) {
        let run = &scans[from..to];
        let fits = |at: &usize| run.iter().zip(&packets[*at..]).all(|((_, scan), packet)| was_made_of(scan, packet));
        let at = (next..=packets.len().saturating_sub(run.len())).find(fits);
        let at = at.unwrap_or_else(|| {
            let in_a_row = run.iter().zip(&packets[next..]).take_while(|((_, scan), packet)| was_made_of(scan, packet)).count();
            panic!("scans {} to {to} are no packets in a row after packet {next}, but the first {in_a_row}\n{said}", from + 1)
        });
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
    found.lost_after = packets.len() - next;
    found
}

/// The numbers of the pictures in a log increase up to the end of the drive.
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

/// Drives once, kills the process then, and checks the log.
#[track_caller]
fn kill_at(process: &str, moment: Moment) {
    let simulator = process == "simulator";
    let mut drive = Drive::start(simulator, ![Moment::PacketsWaiting, Moment::Ending].contains(&moment));
    match moment {
        Moment::Starting => kill(drive.run.pid_of(process)),
        Moment::Steady => {
            drive.wait_for_scans();
            kill(drive.run.pid_of(process));
        }
        Moment::PacketsWaiting => {
            drive.fill_the_line();
            if simulator { drive.take_the_line_away() } else { kill(drive.run.pid_of(process)) }
        }
        Moment::WritingCheckpoint => drive.kill_while_it_writes_a_checkpoint(process),
        Moment::Ending if simulator => drive.kill_the_simulator_at_the_end(),
        Moment::Ending => drive.kill_the_driver_at_the_end(),
    }
    let packets = drive.packets();
    let (sandbox, ended) = drive.end(process);

    let log = sandbox.path("demo-out").join("drive.mcap");
    let found = check_scans(&scans(&log), &packets, simulator, &ended.stderr);
    let what = format!("{process} killed {moment:?}: {found:?}\n{}", ended.stderr);
    let in_mid_drive = ![Moment::Starting, Moment::Ending].contains(&moment);
    assert!(!in_mid_drive || found.marked > 0, "{what}");
    // Packets on the line are lost with the robot, not with the driver.
    let waited = WAITING as usize;
    match (simulator, moment) {
        (true, Moment::PacketsWaiting) => assert!(found.lost_between >= waited, "{what}"),
        (true, Moment::Ending) => assert!(found.lost_after >= waited, "{what}"),
        (false, Moment::PacketsWaiting) => assert!(found.lost_between < waited, "{what}"),
        // The packet whose scan was to be published after the checkpoint.
        (false, Moment::WritingCheckpoint) => assert!(found.lost_between > 0, "{what}"),
        _ => {}
    }
    assert!(found.lost_after == 0 || simulator && moment == Moment::Ending, "{what}");
    if simulator {
        check_pictures(&log, &packets);
    }
}

/// A reader that is killed at the end receives the last scans again as long as the driver stays: the map is that of the log.
#[track_caller]
fn kill_a_reader(reader: &str) {
    let mut drive = Drive::start(false, true);
    drive.kill_a_reader_at_the_end(reader);
    drive.end(reader);
}

#[test]
fn mapping_killed_after_the_driver_ended_resumes() {
    kill_a_reader("mapping");
}

#[test]
fn std_killed_after_the_driver_ended_resumes() {
    kill_a_reader("std");
}

#[test]
fn fti_killed_after_the_driver_ended_resumes() {
    kill_a_reader("fti");
}

#[test]
fn a_driver_killed_when_it_starts_restarts() {
    kill_at("pioneer", Moment::Starting);
}

#[test]
fn a_driver_killed_in_mid_drive_marks_the_gap() {
    kill_at("pioneer", Moment::Steady);
}

#[test]
fn a_driver_killed_with_packets_waiting_takes_them_later() {
    kill_at("pioneer", Moment::PacketsWaiting);
}

#[test]
fn a_driver_killed_while_writing_a_checkpoint_marks_the_gap() {
    kill_at("pioneer", Moment::WritingCheckpoint);
}

#[test]
fn a_driver_killed_when_asked_to_stop_loses_no_scan() {
    kill_at("pioneer", Moment::Ending);
}

#[test]
fn a_simulator_killed_when_it_starts_restarts() {
    kill_at("simulator", Moment::Starting);
}

#[test]
fn a_simulator_killed_in_mid_drive_marks_the_gap() {
    kill_at("simulator", Moment::Steady);
}

#[test]
fn a_simulator_killed_with_packets_waiting_loses_them() {
    kill_at("simulator", Moment::PacketsWaiting);
}

#[test]
fn a_simulator_killed_while_writing_a_checkpoint_resumes() {
    kill_at("simulator", Moment::WritingCheckpoint);
}

#[test]
fn a_simulator_killed_on_arrival_loses_the_last_packets() {
    kill_at("simulator", Moment::Ending);
}
