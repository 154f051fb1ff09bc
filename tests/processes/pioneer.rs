//! The driver as a real process at a real pseudo-terminal: fed a recorded session, killed, cut off, stopped.

use std::ffi::OsStr;
use std::os::fd::OwnedFd;
use std::os::unix::ffi::OsStrExt;
use std::path::Path;
use std::process::{Child, Command, Stdio};

use ::pioneer::Parameters;
use ::pioneer::recording::decode;
use bus::{Domain, Reader, Received};
use messages::{AFTER_DOUBT, SonarScan};
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::fs::{Mode, OFlags};
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use rustix::termios::{OptionalActions, tcgetattr, tcsetattr};

/// Nothing here takes this long; a test that waits for it hangs.
const WATCHDOG_S: i64 = 60;

/// A driver that does not outlive its test.
struct Driver(Child);

impl Drop for Driver {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

fn start_driver(domain: &Domain, incarnation: u32, settings: &Path) -> Driver {
    let membership = domain.membership_for("pioneer", incarnation, settings);
    let mut command = Command::new(env!("CARGO_BIN_EXE_stillmap"));
    command.args(["process", "pioneer"]).envs(membership.environment()).stdout(Stdio::null());
    Driver(command.spawn().unwrap())
}

fn recording(name: &str) -> Vec<u8> {
    std::fs::read(Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/pioneer").join(name)).unwrap()
}

/// The robot's end of a line. Like a robot, it keeps the line up when its client is gone.
struct Line {
    robot: OwnedFd,
    _client: OwnedFd,
    deframer: psos::Deframer,
}

impl Line {
    /// Opens a pseudo-terminal and puts it under this name.
    fn open(name: &Path) -> Self {
        let robot = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY | OpenptFlags::CLOEXEC).unwrap();
        grantpt(&robot).unwrap();
        unlockpt(&robot).unwrap();
        let device = ptsname(&robot, Vec::new()).unwrap();
        let device = Path::new(OsStr::from_bytes(device.to_bytes()));
        let client = rustix::fs::open(device, OFlags::RDWR | OFlags::NOCTTY | OFlags::CLOEXEC, Mode::empty()).unwrap();
        let mut mode = tcgetattr(&client).unwrap();
        mode.make_raw();
        tcsetattr(&client, OptionalActions::Now, &mode).unwrap();
        let _ = std::fs::remove_file(name);
        std::os::unix::fs::symlink(device, name).unwrap();
        Self { robot, _client: client, deframer: psos::Deframer::new() }
    }

    fn say(&self, mut bytes: &[u8]) {
        while !bytes.is_empty() {
            let count = rustix::io::write(&self.robot, bytes).unwrap();
            bytes = &bytes[count..];
        }
    }

    /// Waits until the driver has said this.
    fn wait_for(&mut self, number: u8) {
        let mut bytes = [0; 256];
        loop {
            wait(vec![PollFd::from_borrowed_fd(std::os::fd::AsFd::as_fd(&self.robot), PollFlags::IN)], "the driver to speak");
            let count = rustix::io::read(&self.robot, &mut bytes).unwrap();
            if self.deframer.push(&bytes[..count]).iter().any(|frame| frame.data[0] == number) {
                return;
            }
        }
    }
}

fn wait(mut on: Vec<PollFd<'_>>, what: &str) {
    let woken = poll(&mut on, Some(&Timespec { tv_sec: WATCHDOG_S, tv_nsec: 0 })).unwrap();
    assert!(woken > 0, "waited {WATCHDOG_S} s for {what}");
}

/// The next scans of the stream, up to number `until`; with `None`, up to its end.
fn scans(domain: &Domain, reader: &mut Reader<SonarScan>, until: Option<u64>) -> Vec<(u64, u64, SonarScan)> {
    let mut taken = Vec::new();
    loop {
        match reader.take().unwrap() {
            Some(Received::Message(message)) => {
                assert_eq!(message.lost_before(), 0);
                taken.push((message.seq(), message.stamp_ns(), *message));
                if until == Some(message.seq()) {
                    return taken;
                }
            }
            Some(Received::End { seq }) => {
                assert_eq!((until, taken.last().map_or(seq, |last| last.0)), (None, seq));
                return taken;
            }
            None => {
                let on = domain.descriptors().into_iter().map(|fd| PollFd::from_borrowed_fd(fd, PollFlags::IN)).collect();
                wait(on, "a scan");
                domain.refresh();
            }
        }
    }
}

fn terminate(mut driver: Driver) {
    rustix::process::kill_process(rustix::process::Pid::from_child(&driver.0), rustix::process::Signal::TERM).unwrap();
    assert!(driver.0.wait().unwrap().success());
}

/// The recording's handshake (SYNC0 to SYNC2), and its status packets one by one.
fn parts(bytes: &[u8]) -> (&[u8], Vec<&[u8]>) {
    let frames = psos::Deframer::new().push(bytes);
    let packet = |frame: &psos::Frame| &bytes[frame.start as usize..][..frame.data.len() + 5];
    let sips: Vec<_> = frames.iter().filter(|frame| psos::Sip::is_sip(&frame.data)).map(packet).collect();
    (&bytes[..frames[3].start as usize], sips)
}

#[test]
fn a_session_survives_a_killed_driver_and_a_pulled_cable() {
    let folder = std::env::temp_dir().join(format!("stillmap-test-pioneer-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let port = folder.join("port");
    let settings = folder.join("settings.toml");
    let text = "name = 'test'\n[[process]]\nname = 'driver'\nrun = 'pioneer'\n[pioneer]\nport = 'port'\n";
    std::fs::write(&settings, text).unwrap();
    let mut domain = Domain::open(&format!("test-pio-{}", std::process::id()), 1.0).unwrap();
    let mut reader = domain.reader().unwrap();
    let bytes = recording("aria291-wander_mobilesim-pion1x.s2c.bin");
    let expect = decode(&bytes, &Parameters::default()).scans;
    let (handshake, sips) = parts(&bytes);

    // The driver is there before the robot is. Whatever was said before it listens, it takes.
    let driver = start_driver(&domain, 0, &settings);
    let mut line = Line::open(&port);
    line.say(handshake);
    line.wait_for(psos::number::SYNC2);
    line.say(&sips[..200].concat());
    let mut found = scans(&domain, &mut reader, Some(200));

    // Killed, started again while the robot talks on: no handshake, no scan twice, no jump.
    drop(driver);
    domain.remove_dead_nodes();
    line.say(&sips[200..230].concat());
    let driver = start_driver(&domain, 1, &settings);
    line.say(&sips[230..].concat());
    found.extend(scans(&domain, &mut reader, Some(389)));
    assert_eq!(found.len(), 389);
    for (place, (seq, stamp_ns, scan)) in found.iter().enumerate() {
        assert_eq!(*seq, place as u64 + 1);
        assert_eq!((scan.pose, scan.readings()), (expect[place].pose, expect[place].readings()), "scan {seq}");
        assert!(place == 0 || *stamp_ns > found[place - 1].1);
    }
    assert_eq!(found[200].2.after_gap, 1, "the killed process may have taken bytes with it");

    // The cable is pulled and put in again: a new handshake, and the pose continues where it was.
    drop(line);
    let mut line = Line::open(&port);
    line.wait_for(psos::number::SYNC0);
    line.say(handshake);
    line.wait_for(psos::number::SYNC2);
    line.say(&sips[..100].concat());
    let again = scans(&domain, &mut reader, Some(489));
    assert_eq!((again[0].0, again[0].2.after_gap, again[0].2.pose), (390, AFTER_DOUBT, found[388].2.pose));
    let moved = |scans: &[SonarScan], to: usize| (scans[to].pose.x_m - scans[0].pose.x_m).hypot(scans[to].pose.y_m - scans[0].pose.y_m);
    let after: Vec<_> = again.iter().map(|(.., scan)| *scan).collect();
    assert!((moved(&after, 99) - moved(&expect, 99)).abs() < 1e-9);

    // Stopped: the robot is closed and the stream ended.
    terminate(driver);
    line.wait_for(psos::number::CLOSE);
    assert_eq!(scans(&domain, &mut reader, None), []);
    drop(reader);
    domain.close().unwrap();
    std::fs::remove_dir_all(&folder).unwrap();
}
