//! A serial line that flips, loses and invents bits costs packets but neither the driver nor the map.

use std::fs::File;
use std::io::{Read, Write};
use std::os::fd::OwnedFd;
use std::path::{Path, PathBuf};

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use rustix::termios::{OptionalActions, tcgetattr, tcsetattr};

use crate::harness::{Deployment, FREE, PgmMap, Sandbox, counter, is_running, worlds};

/// A pseudo-terminal whose slave stays open: the pump has the master, the driver opens the path.
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

/// Carries bytes until an end closes; with noise one bit in a thousand is flipped, and bytes are lost and invented.
fn pump(mut from: File, mut to: File, mut noise: Option<ChaCha8Rng>) {
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
                byte ^= u8::from(noise.random_ratio(1, 1000)) << bit;
            }
            if !noise.random_ratio(1, 5000) {
                carried.push(byte);
            }
            if noise.random_ratio(1, 5000) {
                carried.extend((0..noise.random_range(0..16)).map(|k| (k * 37) as u8));
            }
        }
        if to.write_all(&carried).is_err() {
            return;
        }
    }
}

#[test]
fn a_noisy_line_costs_packets_and_leaves_the_map_intact() {
    let sandbox = Sandbox::new();
    let (master, _slave, port) = terminal();
    let noise = Deployment::new("noise", &["mapping", "simulator", "pioneer"]);
    let noise = noise.set("simulator.world", worlds::path("corridor-empty")).set("pioneer.port", port);
    let mut run = sandbox.run(&noise, &["--speed", "5"]);
    run.wait_for("simulator", "it runs", is_running);
    let robot = open_raw(&sandbox.runtime().join("noise/robot"));

    let to_robot = (master.try_clone().unwrap(), File::from(robot.try_clone().unwrap()));
    let from_robot = (File::from(robot), master);
    std::thread::spawn(move || pump(to_robot.0, to_robot.1, None));
    std::thread::spawn(move || pump(from_robot.0, from_robot.1, Some(ChaCha8Rng::seed_from_u64(1))));

    run.wait_for("pioneer", "it counts bad checksums", |it| counter(it, "bad checksums") > Some(20));
    let ended = run.end();
    ended.assert_code(0);
    assert_eq!(ended.restarted(), None);
    let map = PgmMap::read(&sandbox.path("noise-out"));
    assert!(map.wall_share([2.3, -1.0], [3.9, -1.0], 0.1) > 0.8, "the right wall");
    assert!(map.wall_share([6.9, 1.2], [8.6, 1.2], 0.1) > 0.8, "the left wall");
    let free = (20..100).filter(|step| map.at(f64::from(*step) * 0.1, 0.0) == FREE).count();
    assert!(free > 70, "{free} of 80 cells along the robot's path are free");
}
