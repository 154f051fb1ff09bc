//! The probe at a real pseudo-terminal, with time limits that are about half of the real ones, and two baud rates.
#![allow(clippy::unwrap_used, reason = "tests fail by panicking")]

mod support;

use std::ffi::OsStr;
use std::os::fd::OwnedFd;
use std::os::unix::ffi::OsStrExt;
use std::path::{Path, PathBuf};
use std::thread;
use std::time::Instant;

use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use rustix::termios::{OptionalActions, tcgetattr, tcsetattr};
use stillmap_pioneer::{Address, Answer, Parameters, ProbeError, probe};
use support::{MS, Robot};

/// What is at the other end of the line: takes the bytes that came and the time, and answers.
type Device = Box<dyn FnMut(&[u8], u64) -> Vec<u8> + Send>;

/// Serves a device until the returned descriptor's other end is closed.
fn probed(mut device: Device) -> Result<Answer, ProbeError> {
    let line = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY | OpenptFlags::CLOEXEC).unwrap();
    grantpt(&line).unwrap();
    unlockpt(&line).unwrap();
    let path: PathBuf = Path::new(OsStr::from_bytes(ptsname(&line, Vec::new()).unwrap().to_bytes())).to_owned();
    // Held open and raw, so that nothing is echoed before the probe has opened it, nor the line hung up after it.
    let client_end = std::fs::OpenOptions::new().read(true).write(true).open(&path).unwrap();
    let mut mode = tcgetattr(&client_end).unwrap();
    mode.make_raw();
    tcsetattr(&client_end, OptionalActions::Now, &mode).unwrap();
    let (done, end) = rustix::pipe::pipe().unwrap();
    let served = thread::Builder::new().name("device".to_owned()).spawn(move || serve(&line, &done, &mut device)).unwrap();
    let quick = Parameters { echo_ns: 600 * MS, closing_ns: 100 * MS, bauds: vec![9600, 38400], ..Parameters::default() };
    let answer = probe(&Address::Device(path), &quick);
    drop(end);
    served.join().unwrap();
    answer
}

fn serve(line: &OwnedFd, done: &OwnedFd, device: &mut Device) {
    let started = Instant::now();
    let mut bytes = [0; 256];
    loop {
        let mut ready = [PollFd::new(line, PollFlags::IN), PollFd::new(done, PollFlags::IN)];
        poll(&mut ready, Some(&Timespec { tv_sec: 0, tv_nsec: 10_000_000 })).unwrap();
        if !ready[1].revents().is_empty() {
            return;
        }
        let count = if ready[0].revents().contains(PollFlags::IN) { rustix::io::read(line, &mut bytes).unwrap() } else { 0 };
        let mut said = &*device(&bytes[..count], 1000 * MS + started.elapsed().as_nanos() as u64);
        while !said.is_empty() {
            said = &said[rustix::io::write(line, said).unwrap()..];
        }
    }
}

/// A robot that is unresponsive to its first so many packets.
fn robot(robot: Robot, misses: usize) -> Device {
    let (mut robot, mut received) = (robot, 0);
    Box::new(move |bytes, now_ns| {
        let packets = psos::Deframer::new().push(bytes);
        received += packets.len();
        let mut said = if received > misses { robot.receive(bytes, robot.baud, now_ns) } else { Vec::new() };
        robot.next_sip_ns = robot.next_sip_ns.max(now_ns.saturating_sub(100 * MS));
        said.extend(robot.speak(now_ns));
        said
    })
}

#[test]
fn a_board_that_resets_when_its_port_is_opened_is_found() {
    // Deaf for a round, and to the CLOSE that begins the next.
    let answer = probed(robot(Robot::pioneer_1(), 3)).unwrap();
    assert_eq!(answer.model.map(|model| model.name), Some("pioneer-1"));
    assert!(answer.packets > 10, "{answer:?}");
}

#[test]
fn a_robot_left_synchronised_is_found() {
    let answer = probed(robot(Robot { named: true, ..Robot::p3_dx() }, 0)).unwrap();
    assert_eq!(answer.identity.subclass, "p3dx");
}

#[test]
fn an_echo_is_named() {
    let error = probed(Box::new(|bytes, _| bytes.to_vec())).unwrap_err();
    assert!(matches!(error, ProbeError::Echo { .. }), "{error}");
}

#[test]
fn silence_is_named() {
    let error = probed(Box::new(|_, _| Vec::new())).unwrap_err();
    assert!(matches!(error, ProbeError::Silent { .. }), "{error}");
}
