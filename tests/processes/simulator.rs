//! The simulator as a process: a client at its pseudo-terminal, the truth on the bus.

use std::fs::{File, OpenOptions};
use std::io::{Read, Write};
use std::os::fd::AsFd;
use std::path::Path;
use std::process::{Child, Command, Stdio};

use ::simulator::Optics;
use ::simulator::camera::{Camera, Flaws, Picture};
use bus::{Domain, FrameReader, Reader, Received};
use messages::{CameraFrame, FrameLayout, Pictures, PixelFormat, TruthMask, TruthScan, TruthSurfaces};
use psos::{Deframer, Sip, number};
use runtime::Shell;
use rustix::event::{PollFd, PollFlags, poll};
use rustix::fs::inotify::WatchFlags;
use serde::Serialize;
use state::Schema;

use crate::harness::inotify::Inotify;

/// A second at rest, then three metres towards a wall at 0.5 m/s: so short that the terminal holds all of its packets and none is ever lost.
const WORLD: &str = "
    robot = { start_m = [1, 0], speed_m_s = 0.5, way = [{ to_m = [4, 0] }] }
    wall = [{ along_m = [[6, -2], [6, 2]] }]
";

/// A deployment of nothing but the simulator, 20 times as fast as the wall clock.
struct Deployment {
    domain: Domain,
    folder: tempfile::TempDir,
}

fn deployment(name: &str) -> Deployment {
    deployment_with(name, "")
}

/// The same with more in its settings.
fn deployment_with(name: &str, more: &str) -> Deployment {
    let folder = tempfile::tempdir().unwrap();
    let world = folder.path().join("world.toml");
    std::fs::write(&world, WORLD).unwrap();
    std::fs::write(folder.path().join("settings.toml"), SETTINGS.replace("WORLD", world.to_str().unwrap()) + more).unwrap();
    let domain = Domain::open(&format!("test-sim-{}-{name}", std::process::id()), 20.0).unwrap();
    Deployment { domain, folder }
}

const SETTINGS: &str = "
    name = 'test'
    [[process]]
    name = 'robot'
    run = 'simulator'
    [[process]]
    name = 'driver'
    run = 'pioneer'
    [simulator]
    world = 'WORLD'
";

impl Deployment {
    /// Starts the simulator; it may take a moment until its port is there.
    fn start(&self) -> Simulator {
        let membership = self.domain.membership_for("robot", 0, &self.folder.path().join("settings.toml"));
        let mut command = Command::new(env!("CARGO_BIN_EXE_stillmap"));
        command.args(["process", "simulator"]).envs(membership.environment()).stdout(Stdio::null());
        Simulator(command.spawn().unwrap())
    }

    fn port(&self) -> std::path::PathBuf {
        self.domain.directory().join("robot")
    }
}

/// A simulator that does not outlive its test.
struct Simulator(Child);

impl Simulator {
    /// Waits for the end of its drive.
    fn join(mut self) {
        assert!(self.0.wait().unwrap().success());
    }
}

impl Drop for Simulator {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// Waits for the simulator's port.
fn connect(port: &Path) -> File {
    let folder = Inotify::watch(port.parent().unwrap(), WatchFlags::CREATE | WatchFlags::MOVED_TO);
    let mut client = None;
    folder.wait_until("the port of the simulator", || {
        client = OpenOptions::new().read(true).write(true).open(port).ok();
        client.is_some()
    });
    client.unwrap()
}

/// The data of the next packets; none when the robot has hung up.
fn listen(client: &mut File, deframer: &mut Deframer) -> Vec<Vec<u8>> {
    let mut bytes = [0; 4096];
    loop {
        poll(&mut [PollFd::new(&client.as_fd(), PollFlags::IN)], None).unwrap();
        // A robot that hangs up is the end of the file or an error, by the moment.
        let count = client.read(&mut bytes).unwrap_or(0);
        let packets: Vec<_> = deframer.push(&bytes[..count]).into_iter().map(|frame| frame.data).collect();
        if count == 0 || !packets.is_empty() {
            return packets;
        }
    }
}

/// Opens the robot and takes its packets until it hangs up, with a look at the bus after each.
fn ride(client: &mut File, mut look: impl FnMut()) -> Vec<Sip> {
    let mut deframer = Deframer::new();
    for step in [number::SYNC0, number::SYNC1, number::SYNC2] {
        client.write_all(&psos::Command::plain(step).encode().unwrap()).unwrap();
        assert_eq!(listen(client, &mut deframer)[0][0], step);
    }
    client.write_all(&psos::Command::plain(number::OPEN).encode().unwrap()).unwrap();
    let mut sips = Vec::new();
    loop {
        let packets = listen(client, &mut deframer);
        look();
        if packets.is_empty() {
            return sips;
        }
        sips.extend(packets.iter().map(|data| Sip::decode(data).unwrap()));
    }
}

/// What a simulator saves, by the names that its version is made of.
#[derive(Serialize, Schema)]
struct DriveState {
    packets: u64,
    sent: u64,
}

/// What it saves after so many packets made and sent.
fn state(packets: u64, sent: u64) -> Vec<u8> {
    state::encode(&DriveState { packets, sent }, Vec::new())
}

/// What the bus tells.
struct Truths {
    scans: Reader<TruthScan>,
    chunks: Reader<TruthSurfaces>,
    surfaces: Vec<TruthSurfaces>,
    taken: Vec<(u64, TruthScan)>,
    ended: Option<u64>,
}

impl Truths {
    fn of(deployment: &mut Deployment) -> Self {
        Self {
            scans: deployment.domain.reader().unwrap(),
            chunks: deployment.domain.reader().unwrap(),
            surfaces: Vec::new(),
            taken: Vec::new(),
            ended: None,
        }
    }

    fn take(&mut self) {
        while let Some(Received::Message(chunk)) = self.chunks.take().unwrap() {
            self.surfaces.push(*chunk);
        }
        while let Some(received) = self.scans.take().unwrap() {
            match received {
                Received::Message(message) => self.taken.push((message.seq(), *message)),
                Received::End { seq } => self.ended = Some(seq),
            }
        }
    }
}

#[test]
fn a_client_receives_every_packet_and_the_bus_the_truth() {
    let mut deployment = deployment("ride");
    let mut truths = Truths::of(&mut deployment);
    let simulator = deployment.start();
    let sips = ride(&mut connect(&deployment.port()), || truths.take());
    simulator.join();

    assert_eq!(sips.len(), 70, "7 s, ten a second, none lost");
    assert_eq!(truths.taken.iter().map(|(seq, _)| *seq).collect::<Vec<_>>(), (1..=70).collect::<Vec<_>>());
    assert_eq!(truths.ended, Some(70));
    for (sip, (seq, truth)) in sips.iter().zip(&truths.taken) {
        let claimed = (truth.odometry.x_m * 1000.0 / 0.05066).round().rem_euclid(32768.0);
        assert_eq!(f64::from(sip.x), claimed, "packet {seq}");
        assert!((truth.pose.x_m - truth.odometry.x_m - 1.0).abs() < 1e-9);
        let ranges: Vec<f64> = sip.readings.iter().map(|reading| f64::from(reading.range) * 0.1734 / 1000.0).collect();
        let told: Vec<f64> = truth.readings[..truth.count as usize].iter().map(|reading| reading.range_m).collect();
        assert_eq!(ranges, told, "packet {seq}");
    }
    let chunks: Vec<_> = truths.surfaces.iter().map(|chunk| (chunk.count, chunk.total, chunk.start.x_m)).collect();
    assert_eq!(chunks, [(1, 1, 1.0)]);
    let membership = deployment.domain.membership_for("robot", 1, "settings.toml".as_ref());
    let saved = Shell::join(membership).unwrap().checkpoint().restore(|saved| Ok::<_, String>(saved.state.to_vec()));
    assert_eq!(saved.as_deref(), Some(state(70, 70).as_ref()));
    drop(truths);
    assert!(!deployment.port().exists());
    deployment.domain.close().unwrap();
}

#[test]
fn a_restart_resumes_the_drive_with_a_robot_that_was_off() {
    let mut deployment = deployment("kill");
    let mut truths = Truths::of(&mut deployment);
    // What an earlier incarnation left behind that was killed after 40 packets, 38 of them sent.
    let membership = deployment.domain.membership_for("robot", 0, "settings.toml".as_ref());
    Shell::join(membership).unwrap().checkpoint().save(&state(40, 38));

    let simulator = deployment.start();
    let sips = ride(&mut connect(&deployment.port()), || truths.take());
    simulator.join();

    assert_eq!(sips.len(), 30);
    assert_eq!((truths.taken[0].0, truths.ended), (39, Some(68)));
    assert!((truths.taken[0].1.odometry.x_m - 31.0 * 0.05).abs() < 1e-9, "the world remembers");
    assert_eq!(f64::from(sips[0].x), (50.0_f64 / 0.05066).round(), "the robot has forgotten: 5 cm since it was switched on");
    drop(truths);
    deployment.domain.close().unwrap();
}

/// Numbers, stamps and bytes of what has come.
fn pictures<P: Pictures>(reader: &mut FrameReader<P>) -> Vec<(u64, u64, Vec<u8>)> {
    let mut taken = Vec::new();
    while let Some(received) = reader.take().unwrap() {
        if let Received::Message(frame) = received {
            assert_eq!(frame.layout(), FrameLayout::packed(80, 60, PixelFormat::Grey));
            taken.push((frame.seq(), frame.stamp_ns(), frame.bytes().to_vec()));
        }
    }
    taken
}

#[track_caller]
fn check_pictures(taken: &[(u64, u64, Vec<u8>)], first: u64, which: fn(&Picture) -> &Vec<u8>) {
    let optics = Optics { size_px: [80, 60], interval_ns: 200_000_000, ..Optics::default() };
    let mut camera = Camera::new(&world_file::parse("world", WORLD).unwrap(), &optics, &Flaws::default(), 1);
    assert_eq!(taken.iter().map(|(seq, ..)| *seq).collect::<Vec<_>>(), (first..=camera.total_frames()).collect::<Vec<_>>());
    let mut picture = Picture::default();
    for (seq, stamp_ns, bytes) in taken {
        camera.take(*seq, &mut picture);
        assert!(bytes == which(&picture), "frame {seq}");
        assert_eq!(stamp_ns - taken[0].1, camera.stamp_ns(*seq) - camera.stamp_ns(first));
    }
}

#[test]
fn the_camera_shows_the_drive_also_after_a_kill() {
    let more = "[camera]\nwidth = 80\nheight = 60\nrate_hz = 5\n[simulator.camera]\nprovides = 'pictures'\n";
    for (name, left_behind, first) in [("camera", None, 1), ("camera-kill", Some(state(40, 38)), 21)] {
        let deployment = deployment_with(name, more);
        let mut watcher = Shell::join(deployment.domain.membership_for("watcher", 0, "settings.toml".as_ref())).unwrap();
        let mut frames: FrameReader<CameraFrame> = watcher.frame_reader().unwrap();
        let mut masks: FrameReader<TruthMask> = watcher.frame_reader().unwrap();
        if let Some(state) = left_behind {
            let membership = deployment.domain.membership_for("robot", 0, "settings.toml".as_ref());
            Shell::join(membership).unwrap().checkpoint().save(&state);
        }
        let simulator = deployment.start();
        let (mut seen, mut labels) = (Vec::new(), Vec::new());
        let mut look = || {
            seen.extend(pictures(&mut frames));
            labels.extend(pictures(&mut masks));
        };
        ride(&mut connect(&deployment.port()), &mut look);
        simulator.join();
        look();
        check_pictures(&seen, first, |picture| &picture.grey);
        check_pictures(&labels, first, |picture| &picture.labels);
        drop((frames, masks, watcher));
        deployment.domain.close().unwrap();
    }
}
