//! A program on the shared port and the driver's session, in front of one robot.
#![allow(clippy::unwrap_used, reason = "tests fail by panicking")]

mod support;

use psos::{Command, Identity, Sip, number};
use stillmap_pioneer::{Event, Input, NotForwarded, Parameters};
use support::{Drive, MS, Robot, S};

/// A robot whose counters start at zero when it is opened, at rest, with a driver that is connected.
fn connected() -> Drive {
    let mut drive = Drive::new(Robot { m_per_cycle: 0.0, zeroes: true, ..Robot::pioneer_1() });
    drive.run(3 * S);
    assert!(matches!(&drive.events[..], [Event::Connected { .. }]), "{:?}", drive.events);
    drive.events.clear();
    drive.client_packets();
    drive
}

/// What real clients do when they meet an open robot: a SYNC0 that brings status packets, CLOSE, the handshake.
fn connect_client(drive: &mut Drive) {
    drive.client(number::SYNC0);
    drive.run(500 * MS);
    assert!(drive.client_packets().iter().all(|data| Sip::is_sip(data)), "an open robot echoes nothing");
    drive.client(number::CLOSE);
    drive.run(500 * MS);
    drive.client_packets();
    for step in [number::SYNC0, number::SYNC1] {
        drive.client(step);
        assert_eq!(drive.client_packets(), [[step]]);
        drive.run(200 * MS);
    }
    drive.client(number::SYNC2);
    let answer = drive.client_packets();
    assert_eq!(Identity::decode(&answer[0]).unwrap().subclass, "pion1m");
    drive.client(number::OPEN);
    drive.run(S);
    assert!(drive.client_packets().iter().filter(|data| Sip::is_sip(data)).count() >= 9);
}

fn commands(drive: &Drive) -> Vec<u8> {
    drive.sent.iter().map(|packet| packet[3]).collect()
}

#[test]
fn a_client_connects_as_if_directly_and_the_map_goes_with_it() {
    let mut drive = connected();
    let (scans, x_m) = (drive.scans.len(), drive.pose_x_m());
    connect_client(&mut drive);
    assert!(drive.scans.len() > scans + 9);
    assert!((drive.pose_x_m() - x_m).abs() < 1e-9);
    assert!(!drive.events.iter().any(|event| matches!(event, Event::PoseDoubtful { .. })), "it stood: {:?}", drive.events);
    assert_eq!(drive.session.doubtful_poses(), 0);
    drive.robot.m_per_cycle = 0.03;
    drive.run(2 * S);
    drive.client(number::PULSE);
    drive.run(2 * S);
    assert!((drive.pose_x_m() - x_m - 1.2).abs() < 0.05, "{}", drive.pose_x_m());
    drive.check_stream();
}

#[test]
fn while_a_client_commands_the_driver_sends_no_pulse() {
    let mut drive = connected();
    connect_client(&mut drive);
    drive.sent.clear();
    for _ in 0..5 {
        drive.client(number::PULSE);
        drive.run(S);
    }
    assert_eq!(commands(&drive), [0; 0], "the robot's watchdog must see its client fall silent");
    assert!(drive.session.due_ns().unwrap() > drive.now_ns, "nothing is overdue");
}

#[test]
fn a_client_that_closes_the_robot_leaves_it_to_the_driver() {
    let mut drive = connected();
    connect_client(&mut drive);
    let scans = drive.scans.len();
    drive.client(number::CLOSE);
    drive.run(6 * S);
    assert!(drive.scans.len() > scans + 15);
    assert!(drive.robot.open);
    assert_eq!(drive.session.doubtful_poses(), 0);
    drive.sent.clear();
    drive.run(2 * S);
    assert!(commands(&drive).contains(&number::PULSE), "the driver keeps the session alive again");
}

#[test]
fn after_a_dead_client_the_robot_is_closed_once_it_stands() {
    let mut drive = connected();
    connect_client(&mut drive);
    drive.robot.m_per_cycle = 0.03;
    drive.run(S);
    let x_m = drive.robot.x_m;
    drive.sent.clear();
    drive.step(Input::ClientLeft);
    drive.run(2 * S);
    assert_eq!(commands(&drive), [0; 0], "it moves: its watchdog has to stop it");
    drive.robot.m_per_cycle = 0.0;
    drive.run(200 * MS);
    assert_eq!(commands(&drive), [number::CLOSE]);
    drive.run(3 * S);
    assert!(drive.robot.open && drive.events.contains(&Event::ClientLeft));
    assert_eq!(drive.session.doubtful_poses(), 0);
    assert!((drive.pose_x_m() - (drive.robot.x_m - x_m) - 0.3).abs() < 0.05, "{}", drive.pose_x_m());
}

#[test]
fn a_robot_that_does_not_stop_is_closed_all_the_same() {
    let mut drive = connected();
    connect_client(&mut drive);
    drive.robot.m_per_cycle = 0.03;
    drive.run(S);
    drive.step(Input::ClientLeft);
    drive.run(8 * S);
    assert!(drive.events.contains(&Event::ClientLeft));
    assert_eq!(drive.session.doubtful_poses(), 1, "it moved while it was closed");
}

#[test]
fn a_client_that_leaves_a_closed_robot_is_followed_at_once() {
    let mut drive = connected();
    drive.client(number::CLOSE);
    drive.step(Input::ClientLeft);
    drive.run(S);
    assert!(drive.robot.open);
}

#[test]
fn a_packet_on_its_way_at_close_is_of_the_old_session() {
    let mut drive = connected();
    drive.robot.m_per_cycle = 0.02;
    drive.run(S);
    drive.robot.m_per_cycle = 0.0;
    drive.run(S);
    let (x_m, late) = (drive.pose_x_m(), drive.robot.sip());
    drive.client(number::CLOSE);
    let scans = drive.scans.len();
    drive.run(20 * MS);
    drive.step(Input::Bytes(&late.encode().unwrap()));
    assert_eq!(drive.scans.len(), scans + 1, "its readings count");
    assert!(drive.session.note("x").starts_with("lent to"), "{}", drive.session.note("x"));
    for step in [number::SYNC0, number::SYNC1, number::SYNC2, number::OPEN] {
        drive.client(step);
        drive.run(100 * MS);
    }
    drive.run(S);
    assert!((drive.pose_x_m() - x_m).abs() < 1e-9, "{} after {x_m}", drive.pose_x_m());
    assert_eq!(drive.session.doubtful_poses(), 0);
}

#[test]
fn a_client_that_gives_up_its_handshake_leaves_it_to_the_driver() {
    for steps in [&[number::CLOSE][..], &[number::CLOSE, number::SYNC0, number::SYNC1], &[number::CLOSE, 0, 1, 2]] {
        let mut drive = connected();
        for &step in steps {
            drive.client(step);
            drive.run(500 * MS);
        }
        drive.run(8 * S);
        assert!(drive.robot.open, "after {steps:?}");
        let scans = drive.scans.len();
        drive.run(S);
        assert!(drive.scans.len() >= scans + 9, "after {steps:?}");
    }
}

#[test]
fn a_close_that_is_lost_loses_no_motion() {
    let mut drive = connected();
    drive.robot.m_per_cycle = 0.03;
    drive.run(S);
    let (x_m, pose_m) = (drive.robot.x_m, drive.pose_x_m());
    drive.quiet = true;
    drive.client(number::CLOSE);
    drive.quiet = false;
    drive.run(3 * S);
    assert!((drive.pose_x_m() - pose_m - (drive.robot.x_m - x_m)).abs() < 0.05);
    assert_eq!(drive.session.doubtful_poses(), 0);
}

#[test]
fn seto_of_a_client_moves_no_pose() {
    for travelled_m in [0.05, 0.5] {
        let mut drive = connected();
        drive.robot.m_per_cycle = travelled_m / 10.0;
        drive.run(S);
        drive.robot.m_per_cycle = 0.0;
        drive.run(S);
        let pose_m = drive.pose_x_m();
        drive.client(number::SETO);
        drive.run(2 * S);
        assert!((drive.pose_x_m() - pose_m).abs() < 1e-9, "{} after {pose_m}", drive.pose_x_m());
        assert_eq!(drive.session.doubtful_poses(), 0);
    }
}

#[test]
fn a_change_of_the_lines_speed_is_not_forwarded() {
    let mut drive = connected();
    let hostbaud = Command::int(number::HOSTBAUD, 2).encode().unwrap();
    let received = drive.robot.received.len();
    for _ in 0..9 {
        drive.step(Input::Client(&hostbaud[3..hostbaud.len() - 2]));
    }
    assert_eq!(drive.robot.received.len(), received);
    let reported = drive.events.iter().filter(|it| matches!(it, Event::ClientRefused { why: NotForwarded::Speed, .. })).count();
    assert_eq!((reported, drive.session.client_commands()), (4, (0, 9)), "for the 1st, 2nd, 4th and 8th");
}

#[test]
fn without_a_robot_nothing_is_forwarded() {
    let mut drive = connected();
    drive.quiet = true;
    drive.run(10 * S);
    drive.events.clear();
    drive.client(number::SYNC0);
    assert!(matches!(&drive.events[..], [Event::ClientRefused { why: NotForwarded::NotConnected, .. }]), "{:?}", drive.events);
    drive.quiet = false;
    drive.run(10 * S);
    drive.client_packets();
    connect_client(&mut drive);
}

#[test]
fn motion_commands_pass_unchanged() {
    let mut drive = connected();
    connect_client(&mut drive);
    for command in [Command::int(number::VEL, -300), Command::int(number::RVEL, 20), Command::plain(number::STOP)] {
        let packet = command.encode().unwrap();
        let outputs = drive.session.step(Input::Client(&packet[3..packet.len() - 2]), drive.now_ns);
        assert_eq!(outputs, [stillmap_pioneer::Output::Forward(packet)]);
    }
}

#[test]
fn a_connection_that_ends_with_close_is_the_clients_again() {
    let parameters = Parameters { bauds: Vec::new(), ..Parameters::default() };
    let mut drive = Drive::with(Robot { m_per_cycle: 0.0, zeroes: true, baud: 0, ..Robot::pioneer_1() }, parameters, None, 1000 * S);
    drive.run(3 * S);
    drive.client(number::CLOSE);
    drive.plugged = false;
    drive.run(200 * MS);
    drive.plugged = true;
    drive.sent.clear();
    drive.run(500 * MS);
    assert_eq!(commands(&drive), [0; 0], "the client's handshake");
    drive.client_packets();
    drive.client(number::SYNC0);
    assert_eq!(drive.client_packets(), [[0]]);
}

#[test]
fn a_silent_connection_in_the_network_is_made_anew() {
    let parameters = Parameters { bauds: Vec::new(), ..Parameters::default() };
    let mut drive = Drive::with(Robot { baud: 0, unresponsive: true, ..Robot::pioneer_1() }, parameters, None, 1000 * S);
    drive.run(20 * S);
    let syncs = commands(&drive).iter().filter(|&&number| number == number::SYNC0).count();
    assert!((14..=16).contains(&syncs), "{syncs}");
    drive.robot.unresponsive = false;
    drive.run(10 * S);
    assert!(drive.robot.open);
    assert!(drive.session.note("tcp://x:8101").starts_with("pioneer-1, battery"), "{}", drive.session.note("tcp://x:8101"));
}
