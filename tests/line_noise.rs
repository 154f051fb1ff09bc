//! A serial line that flips bits, cuts and invents bytes costs packets, never the process, and hardly the map.
#![expect(clippy::unwrap_used, clippy::panic, reason = "tests fail by panicking")]

mod harness;

use std::fs::File;
use std::io::{Read, Write};
use std::os::fd::OwnedFd;
use std::path::{Path, PathBuf};

use harness::{Bench, FREE, PgmMap, Run, text};
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use rustix::termios::{OptionalActions, tcgetattr, tcsetattr};

const CORRIDOR: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/config/worlds/corridor-empty.toml");

/// A pseudo-terminal whose slave stays open: the pump keeps the master, the driver opens the path.
fn terminal() -> (File, OwnedFd, PathBuf) {
    let master = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY).unwrap();
    grantpt(&master).unwrap();
    unlockpt(&master).unwrap();
    let path = PathBuf::from(ptsname(&master, Vec::new()).unwrap().into_string().unwrap());
    let slave = open_raw(&path);
    (File::from(master), slave, path)
}

fn open_raw(path: &Path) -> OwnedFd {
    use rustix::fs::{Mode, OFlags};
    let terminal = rustix::fs::open(path, OFlags::RDWR | OFlags::NOCTTY, Mode::empty()).unwrap();
    let mut attributes = tcgetattr(&terminal).unwrap();
    attributes.make_raw();
    tcsetattr(&terminal, OptionalActions::Now, &attributes).unwrap();
    terminal
}

/// xorshift64*: the same noise every time.
struct Noise(u64);

impl Noise {
    fn one_in(&mut self, n: u64) -> bool {
        self.next().is_multiple_of(n)
    }

    fn next(&mut self) -> u64 {
        self.0 ^= self.0 >> 12;
        self.0 ^= self.0 << 25;
        self.0 ^= self.0 >> 27;
        self.0.wrapping_mul(0x2545_f491_4f6c_dd1d) >> 16
    }
}

/// Carries bytes until an end closes; with noise: one bit in a thousand flipped, bytes lost and invented.
fn pump(mut from: File, mut to: File, mut noise: Option<Noise>) {
    let mut buffer = [0; 256];
    while let Ok(count @ 1..) = from.read(&mut buffer) {
        let mut carried = Vec::with_capacity(count + 16);
        for byte in &buffer[..count] {
            let Some(noise) = &mut noise else {
                carried.push(*byte);
                continue;
            };
            let mut byte = *byte;
            for bit in 0..8 {
                byte ^= u8::from(noise.one_in(1000)) << bit;
            }
            if !noise.one_in(5000) {
                carried.push(byte);
            }
            if noise.one_in(5000) {
                carried.extend((0..noise.next() % 16).map(|k| (k * 37) as u8));
            }
        }
        if to.write_all(&carried).is_err() {
            return;
        }
    }
}

#[test]
fn noise_costs_packets_and_hardly_the_map() {
    let bench = Bench::new();
    let (master, _slave, port) = terminal();
    let settings = format!(
        "name = \"noise\"\nout = \"out\"\n\
         [[process]]\nname = \"mapping\"\nrun = \"mapping\"\n\
         [[process]]\nname = \"simulator\"\nrun = \"simulator\"\n\
         [[process]]\nname = \"pioneer\"\nrun = \"pioneer\"\n\
         [simulator]\nworld = {CORRIDOR:?}\n[pioneer]\nport = {port:?}\n"
    );
    let settings = bench.write("noise.toml", &settings);
    let run = Run::start(bench.stillmap(["run", settings.to_str().unwrap(), "--speed", "15"]));
    bench.wait_for("simulator", "it runs", |it| it["state"] == "running");
    bench.remember_domain();
    let folder = std::fs::read_to_string(bench.path("domains-seen")).unwrap();
    let robot = open_raw(&Path::new(&folder).join("robot"));

    let to_robot = (master.try_clone().unwrap(), File::from(robot.try_clone().unwrap()));
    let from_robot = (File::from(robot), master);
    std::thread::spawn(move || pump(to_robot.0, to_robot.1, None));
    std::thread::spawn(move || pump(from_robot.0, from_robot.1, Some(Noise(0x9e37_79b9_7f4a_7c15))));

    let driver = bench.wait_for("pioneer", "it counts bad checksums", |it| it["counters"]["bad checksums"].as_u64() > Some(20));
    assert_eq!(driver["restarts"], 0);
    let output = run.end();
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    assert!(!text(&output.stdout).contains("restarted"), "{}", text(&output.stdout));
    let map = PgmMap::read(&bench.path("out"));
    assert!(map.wall_share([2.3, -1.0], [3.9, -1.0], 0.1) > 0.8, "the right wall");
    assert!(map.wall_share([6.9, 1.2], [8.6, 1.2], 0.1) > 0.8, "the left wall");
    let free = (20..100).filter(|step| map.at(f64::from(*step) * 0.1, 0.0) == FREE).count();
    assert!(free > 70, "{free} of 80 places along the robot's way are free");
}
