//! The machine around the virtual machine of the device tests: what the guest's serial adapter is plugged into.
//!
//! `device-host SOCKETS WORLD COMMAND…` starts COMMAND, a QEMU whose adapter is the socket SOCKETS/adapter, and does what the guest
//! says on SOCKETS/control, a word a line, each answered with `ok`:
//!
//! | word | does |
//! | --- | --- |
//! | `robot`, `stranger`, `nothing` | what is at the other end of the cable: the simulated robot of WORLD at the start of its drive, something that answers like a login, nothing |
//! | `plug`, `pull` | the adapter into the guest, and out of it |
#![expect(clippy::unwrap_used, clippy::print_stderr, reason = "a test fails by panicking")]

use std::io::{BufRead, BufReader, Read, Write};
use std::net::Shutdown;
use std::os::unix::net::{UnixListener, UnixStream};
use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode};
use std::sync::{Arc, Condvar, Mutex};
use std::time::{Duration, Instant};

use simulator::{PACKET_INTERVAL_NS, RobotEnd, Simulation, World};

/// What is at the other end of the cable.
enum End {
    Nothing,
    Stranger,
    Robot(Box<Robot>),
}

struct Robot {
    drive: Simulation,
    end: RobotEnd,
    /// When the next packet is due; none before a client has opened the robot for the first time.
    due: Option<Instant>,
}

/// The cable: its end, and the adapter while it is plugged.
struct Cable {
    end: End,
    adapter: Option<UnixStream>,
}

/// The cable that several threads work at, and what wakes the one that drives the robot.
#[derive(Clone)]
struct SharedCable(Arc<(Mutex<Cable>, Condvar)>);

impl SharedCable {
    /// Changes it, and lets the robot drive if it may now.
    fn change<T>(&self, change: impl FnOnce(&mut Cable) -> T) -> T {
        let (cable, changed) = &*self.0;
        let result = change(&mut cable.lock().unwrap());
        changed.notify_all();
        result
    }
}

fn main() -> ExitCode {
    let mut arguments = std::env::args_os().skip(1);
    let sockets = PathBuf::from(arguments.next().unwrap());
    let world = world_file::read(Path::new(&arguments.next().unwrap())).unwrap();
    let listener = UnixListener::bind(sockets.join("control")).unwrap();
    let mut machine = Command::new(arguments.next().unwrap()).args(arguments).spawn().unwrap();
    let cable = SharedCable(Arc::new((Mutex::new(Cable { end: End::Nothing, adapter: None }), Condvar::new())));
    let drive = cable.clone();
    std::thread::spawn(move || drive_robot(&drive));
    std::thread::spawn(move || obey(&listener, &sockets.join("adapter"), &world, &cable));
    let status = machine.wait().unwrap().code();
    match status {
        // The guest ended itself with twice its code and one.
        Some(code) if code % 2 == 1 => ExitCode::from((code / 2) as u8),
        _ => {
            eprintln!("the virtual machine ended without a word: {status:?}");
            ExitCode::FAILURE
        }
    }
}

fn obey(listener: &UnixListener, adapter: &Path, world: &World, cable: &SharedCable) {
    let (control, _) = listener.accept().unwrap();
    for word in BufReader::new(control.try_clone().unwrap()).lines() {
        match word.unwrap().as_str() {
            "plug" => plug(adapter, cable),
            "pull" => pull(cable),
            "robot" => cable.change(|cable| cable.end = End::Robot(Box::new(Robot::new(world)))),
            "stranger" => cable.change(|cable| cable.end = End::Stranger),
            "nothing" => cable.change(|cable| cable.end = End::Nothing),
            other => eprintln!("the guest says {other:?}"),
        }
        (&control).write_all(b"ok\n").unwrap();
    }
}

fn plug(adapter: &Path, cable: &SharedCable) {
    let stream = UnixStream::connect(adapter).unwrap();
    let mut from_guest = stream.try_clone().unwrap();
    cable.change(|cable| cable.adapter = Some(stream));
    let cable = cable.clone();
    std::thread::spawn(move || {
        let mut bytes = [0; 256];
        while let Ok(count @ 1..) = from_guest.read(&mut bytes) {
            cable.change(|cable| {
                let answer = match &mut cable.end {
                    End::Nothing => Vec::new(),
                    End::Stranger => b"\r\nlogin: ".to_vec(),
                    End::Robot(robot) => robot.end.push(&bytes[..count]),
                };
                cable.send(&answer);
            });
        }
    });
}

fn pull(cable: &SharedCable) {
    if let Some(stream) = cable.change(|cable| cable.adapter.take()) {
        stream.shutdown(Shutdown::Both).unwrap();
    }
}

/// Sends the robot's packets when they are due, whether a guest reads them or not.
fn drive_robot(cable: &SharedCable) {
    let (cable, changed) = &*cable.0;
    let mut cable = cable.lock().unwrap();
    loop {
        let (said, due) = match &mut cable.end {
            End::Robot(robot) => (robot.speak(Instant::now()), robot.due),
            End::Nothing | End::Stranger => (Vec::new(), None),
        };
        cable.send(&said);
        cable = match due {
            Some(due) => changed.wait_timeout(cable, due.saturating_duration_since(Instant::now())).unwrap().0,
            None => changed.wait(cable).unwrap(),
        };
    }
}

impl Robot {
    fn new(world: &World) -> Self {
        let settings = settings::Robot::default();
        let body = stillmap::process::robot::body(&settings);
        let drive = Simulation::new(world, &body, 1);
        Self { end: RobotEnd::new(&body, settings.odometry_modulus.get(), drive.odometry()), drive, due: None }
    }

    /// The packets that are due.
    fn speak(&mut self, now: Instant) -> Vec<u8> {
        let mut said = Vec::new();
        if self.due.is_none() && self.end.is_open() {
            self.due = Some(now);
        }
        while let Some(due) = self.due.filter(|due| *due <= now) {
            self.due = Some(due + Duration::from_nanos(PACKET_INTERVAL_NS));
            match self.drive.next_packet() {
                Some((packet, _)) => said.extend(self.end.tick(&packet)),
                // The drive is over: the robot is switched off.
                None => self.due = None,
            }
        }
        said
    }
}

impl Cable {
    /// What is said into a cable that is not plugged, or just being pulled, is lost.
    fn send(&mut self, bytes: &[u8]) {
        if let Some(adapter) = &mut self.adapter
            && adapter.write_all(bytes).is_err()
        {
            self.adapter = None;
        }
    }
}
