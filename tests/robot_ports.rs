//! Robots behind other ports than a serial one, and robot programs outside of the deployment.

use std::fs::{File, OpenOptions};
use std::io::{Read, Write};
use std::net::TcpListener;
use std::path::Path;

use psos::{Command, Deframer, Identity, Sip, number};
use rustix::process::Signal;

use crate::harness::processes::signal;
use crate::harness::{Deployment, FREE, PgmMap, Sandbox, counter, is_running, worlds};

/// A robot program at a terminal, with a protocol of its own.
struct Program {
    terminal: File,
    deframer: Deframer,
}

impl Program {
    fn open(link: &Path) -> Self {
        Self { terminal: OpenOptions::new().read(true).write(true).open(link).unwrap(), deframer: Deframer::new() }
    }

    fn send(&mut self, number: u8) {
        self.terminal.write_all(&Command::plain(number).encode().unwrap()).unwrap();
    }

    /// Waits for a packet of the robot.
    fn wait_for(&mut self, wanted: impl Fn(&[u8]) -> bool) -> Vec<u8> {
        loop {
            let mut bytes = [0; 512];
            let count = self.terminal.read(&mut bytes).unwrap();
            if let Some(frame) = self.deframer.push(&bytes[..count]).into_iter().find(|frame| wanted(&frame.data)) {
                return frame.data;
            }
        }
    }

    /// Goes through the handshake as real clients do.
    fn connect(&mut self) -> Identity {
        for step in [number::SYNC0, number::SYNC1] {
            self.send(step);
            self.wait_for(|data| data == [step]);
        }
        self.send(number::SYNC2);
        let identity = Identity::decode(&self.wait_for(|data| data[0] == number::SYNC2)).unwrap();
        self.send(number::OPEN);
        self.wait_for(Sip::is_sip);
        identity
    }
}

fn sonar_drive(name: &str) -> Deployment {
    let drive = Deployment::new(name, &["mapping", "simulator", "pioneer"]);
    drive.set("simulator.world", worlds::path("corridor-empty")).set("pioneer.port", "simulator")
}

fn assert_maps_the_corridor(out: &Path) {
    let map = PgmMap::read(out);
    assert!(map.wall_share([2.3, -1.0], [3.9, -1.0], 0.1) > 0.8, "the right wall");
    assert!(map.wall_share([6.9, 1.2], [8.6, 1.2], 0.1) > 0.8, "the left wall");
    let free = (20..100).filter(|step| map.at(f64::from(*step) * 0.1, 0.0) == FREE).count();
    assert!(free > 70, "{free} of 80 cells along the robot's path are free");
}

#[test]
fn a_program_on_the_shared_port_uses_the_mapped_robot() {
    let sandbox = Sandbox::new();
    let link = sandbox.path("shared");
    let mut run = sandbox.run(&sonar_drive("share").set("pioneer.share", &link), &["--speed", "4"]);
    run.wait_for("pioneer", "it has 20 packets", |it| counter(it, "packets") > Some(20));
    let mut program = Program::open(&link);
    program.wait_for(Sip::is_sip);
    program.send(number::CLOSE);
    assert_eq!(program.connect().subclass, "pion1m");
    program.terminal.write_all(&Command::int(number::VEL, 200).encode().unwrap()).unwrap();
    run.wait_for("pioneer", "it has forwarded the commands", |it| counter(it, "forwarded commands") >= Some(6));
    program.terminal.write_all(&[0x55; 200]).unwrap();
    run.wait_for_line("sends bytes that are no packets");
    drop(program);
    let ended = run.end();
    ended.assert_code(0);
    assert_eq!(ended.restarted(), None);
    assert!(ended.stderr.contains("has left; closing the robot"), "{}", ended.stderr);
    assert_maps_the_corridor(&sandbox.path("share-out"));
    assert!(!link.exists());
}

#[test]
fn a_robot_behind_a_tcp_port_is_mapped() {
    let sandbox = Sandbox::new();
    let bridge = TcpListener::bind("127.0.0.1:0").unwrap();
    let port = format!("tcp://{}", bridge.local_addr().unwrap());
    let mut run = sandbox.run(&sonar_drive("tcp").set("pioneer.port", &port), &["--speed", "4"]);
    run.wait_for("simulator", "it runs", is_running);
    let robot = File::options().read(true).write(true).open(sandbox.runtime().join("tcp/robot")).unwrap();
    std::thread::spawn(move || {
        // As MobileSim: one client at a time, the next one after it has gone.
        for client in bridge.incoming() {
            let (client, robot) = (client.unwrap(), robot.try_clone().unwrap());
            let (to_client, from_client) = (client.try_clone().unwrap(), client);
            let from_robot = robot.try_clone().unwrap();
            std::thread::spawn(move || pump(from_robot, to_client));
            pump(from_client, robot);
        }
    });
    let ended = run.end();
    ended.assert_code(0);
    assert!(ended.stderr.contains(&format!("opened {port}")), "{}", ended.stderr);
    assert_maps_the_corridor(&sandbox.path("tcp-out"));
}

fn pump(mut from: impl Read, mut to: impl Write) {
    let mut bytes = [0; 256];
    while let Ok(count @ 1..) = from.read(&mut bytes) {
        if to.write_all(&bytes[..count]).is_err() {
            return;
        }
    }
}

#[test]
fn a_port_in_the_network_that_refuses_is_named_once() {
    let sandbox = Sandbox::new();
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap();
    drop(listener);
    let port = format!("tcp://{address}");
    let deployment = Deployment::new("refused", &["mapping", "pioneer"]).set("pioneer.port", &port);
    let mut run = sandbox.run(&deployment, &[]);
    run.wait_for("pioneer", "it has said why", |it| it.note.as_str().contains("connection refused"));
    // A robot that listens later is found.
    let listener = TcpListener::bind(address).unwrap();
    drop(listener.accept().unwrap());
    run.wait_for_line("is gone");
    signal(run.pid(), Signal::INT);
    let ended = run.end();
    let warned = ended.stderr.lines().filter(|line| line.contains("warning: tcp:") && line.contains("refused")).count();
    assert!((1..=2).contains(&warned), "before and after: {}", ended.stderr);
}

#[test]
fn a_robot_behind_a_tcp_port_is_probed() {
    let sandbox = Sandbox::new();
    let refused = sandbox.output(["pioneer", "probe", "tcp://127.0.0.1:1"]);
    refused.assert_code(2);
    assert!(refused.stderr.contains("tcp://127.0.0.1:1: connection refused"), "{}", refused.stderr);
    let silent = TcpListener::bind("127.0.0.1:0").unwrap();
    let port = format!("tcp://{}", silent.local_addr().unwrap());
    let probed = sandbox.output(["pioneer", "probe", &port]);
    probed.assert_code(2);
    assert!(probed.stderr.contains(&format!("{port}: silence: is the robot switched on")), "{}", probed.stderr);
}

#[test]
fn a_simulated_robot_serves_programs_outside_of_the_deployment() {
    let sandbox = Sandbox::new();
    let link = sandbox.path("robot");
    let robot_only = Deployment::new("alone", &["simulator"]).set("simulator.world", worlds::path("corridor-empty"));
    let mut run = sandbox.run(&robot_only.set("simulator.link", &link).set("robot.model", "p3-dx"), &["--speed", "20"]);
    run.wait_for("simulator", "it runs", is_running);
    let mut program = Program::open(&link);
    assert_eq!(program.connect().subclass, "p3dx");
    for _ in 0..20 {
        let sip = Sip::decode(&program.wait_for(Sip::is_sip)).unwrap();
        assert_eq!(sip.tail.len(), 16);
    }
    program.send(number::CLOSE);
    drop(program);
    Program::open(&link).connect();
    run.end().assert_code(0);
}
