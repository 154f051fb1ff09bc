//! What is wrong with a robot or its line is in the log once at each end, and in the status in between.
#![allow(clippy::unwrap_used, reason = "tests fail by panicking")]

mod support;

use psos::number;
use stillmap_pioneer::{Condition, Event};
use support::{Drive, MS, Robot, S};

fn driven(robot: Robot) -> Drive {
    let mut drive = Drive::new(robot);
    drive.run(3 * S);
    drive
}

#[test]
fn duplicate_packets_count_once() {
    let mut drive = Drive::new(Robot::pioneer_1());
    drive.damage = Box::new(|bytes| bytes.repeat(2));
    drive.run(10 * S);
    let mut once = Drive::new(Robot::pioneer_1());
    once.run(10 * S);
    assert_eq!(drive.scans, once.scans);
    assert_eq!(drive.session.duplicates(), once.scans.len() as u64);
    drive.check_stream();
}

#[test]
fn a_robot_at_rest_loses_none_of_its_equal_packets() {
    let drive = driven(Robot { m_per_cycle: 0.0, ..Robot::pioneer_1() });
    assert_eq!((drive.scans.len(), drive.session.duplicates()), (29, 0));
}

#[test]
fn lost_packets_are_said_with_their_share() {
    let mut drive = driven(Robot::pioneer_1());
    let mut count = 0;
    drive.damage = Box::new(move |bytes| {
        count += usize::from(!bytes.is_empty());
        if count % 10 < 3 { Vec::new() } else { bytes }
    });
    drive.run(20 * S);
    assert_eq!(drive.conditions().first().map(|(condition, _)| *condition), Some(Condition::PacketLoss));
    assert!(drive.session.note("x").starts_with("30 % OF THE PACKETS LOST; pioneer-1"), "{}", drive.session.note("x"));
    assert!((55..=65).contains(&drive.session.lost_packets()), "{}", drive.session.lost_packets());
    drive.damage = Box::new(|bytes| bytes);
    drive.run(15 * S);
    assert_eq!((drive.conditions().len(), drive.ended()), (1, vec![Condition::PacketLoss]));
    assert!(drive.session.note("x").starts_with("pioneer-1"));
}

#[test]
fn packets_that_are_all_damaged_are_no_dead_line() {
    let mut drive = driven(Robot::pioneer_1());
    drive.damage = Box::new(|mut bytes| {
        // Every status packet's checksum is wrong; the short answers of a handshake pass.
        if bytes.len() > 20 {
            *bytes.last_mut().unwrap() ^= 0x55;
        }
        bytes
    });
    drive.run(10 * S);
    let lost = drive.events.iter().find(|event| matches!(event, Event::LinkLost { .. })).unwrap();
    assert!(matches!(lost, Event::LinkLost { damaged: 79..=81, .. }), "{lost:?}");
}

#[test]
fn stall_bumpers_and_battery_are_said() {
    let mut drive = driven(Robot::pioneer_1());
    drive.robot.stall_bumpers = (3, 1);
    drive.robot.battery = 100;
    drive.run(3 * S);
    let said = [
        (Condition::Stall, "STALL of both wheels"),
        (Condition::Bumper, "BUMPER pressed: rear 1"),
        (Condition::LowBattery, "BATTERY LOW: 10.0 V"),
    ];
    assert_eq!(drive.conditions(), said);
    let words = said.map(|(_, words)| words).join("; ");
    assert!(drive.session.note("x").starts_with(&words), "{}", drive.session.note("x"));
    drive.robot.stall_bumpers = (0, 0);
    drive.robot.battery = 120;
    drive.run(3 * S);
    assert_eq!(drive.ended(), said.map(|(condition, _)| condition));
    assert!(drive.session.note("x").starts_with("pioneer-1"));
}

#[test]
fn emergency_stop_and_motors_are_said_of_robots_that_tell() {
    let mut drive = driven(Robot { flags: Some(0x26), ..Robot::p3_dx() });
    let said = [(Condition::EmergencyStop, "EMERGENCY STOP pressed"), (Condition::MotorsOff, "motors off")];
    assert_eq!(drive.conditions(), said);
    drive.robot.flags = Some(0x07);
    drive.run(3 * S);
    assert_eq!(drive.ended(), said.map(|(condition, _)| condition));
    let psos = driven(Robot { flags: Some(0x26), ..Robot::pioneer_1() });
    assert_eq!(psos.conditions(), [], "these bits mean something else there");
}

#[test]
fn silent_sonars_are_reported_on_every_model() {
    for robot in [
        Robot { sonars: false, ..Robot::pioneer_1() },
        Robot { has_sonar_command: false, ..Robot::p3_dx() },
        Robot { has_sonar_command: false, flags: Some(7), ..Robot::p3_dx() },
    ] {
        let mut drive = driven(robot);
        assert_eq!(drive.conditions(), [(Condition::NoReadings, "NO SONAR READINGS for 2 s")], "{}", drive.robot.subclass);
        drive.run(10 * S);
        assert!(drive.session.note("x").starts_with("NO SONAR READINGS for 1"), "{}", drive.session.note("x"));
        let asked = drive.robot.received.iter().filter(|&&received| received == number::SONAR).count();
        assert_eq!(asked > 5, drive.robot.subclass == "p3dx", "asked {asked} times");
        drive.robot.sonars = true;
        drive.run(3 * S);
        assert_eq!((drive.conditions().len(), drive.ended()), (1, vec![Condition::NoReadings]));
    }
}

#[test]
fn readings_of_no_sonar_of_this_robot_are_no_readings() {
    // The robot's sonar 3 is not among the two of the settings.
    let mut drive = Drive::new(Robot::pioneer_1());
    drive.damage = Box::new(|bytes| {
        let mut out = Vec::new();
        for frame in psos::Deframer::new().push(&bytes) {
            let packet = psos::Sip::decode(&frame.data).map(|mut sip| {
                sip.readings.iter_mut().for_each(|reading| reading.sonar = 30);
                sip.encode()
            });
            out.extend(packet.unwrap_or_else(|_| psos::encode_frame(&frame.data)).unwrap());
        }
        out
    });
    drive.run(4 * S);
    assert_eq!(drive.conditions(), [(Condition::NoReadings, "NO USABLE SONAR READINGS for 2 s: is robot.model right?")]);
}

#[test]
fn a_dead_line_says_nothing_of_the_sonars() {
    let mut drive = driven(Robot::p3_dx());
    drive.quiet = true;
    let asked = drive.sent.len();
    drive.run(7 * S);
    assert_eq!(drive.conditions(), []);
    assert!(drive.sent[asked..].iter().all(|packet| packet[3] == number::PULSE), "nothing but PULSE");
    drive.quiet = false;
    drive.run(2 * S);
    assert_eq!(drive.conditions(), []);
}

#[test]
fn refused_odometry_names_the_modulus() {
    let mut drive = driven(Robot { modulus: 4096, ..Robot::pioneer_1() });
    drive.run(S);
    let refused: Vec<_> = drive.events.iter().filter(|event| matches!(event, Event::OdometryRefused { .. })).collect();
    assert!(refused.len() > 1 && refused.iter().all(|event| event.to_string().ends_with("it would fit robot.odometry_modulus = 4096")));
    assert_eq!(drive.conditions(), [(Condition::Odometry, "ODOMETRY REFUSED: set robot.odometry_modulus = 4096")]);
    drive.run(20 * S);
    assert_eq!((drive.conditions().len(), drive.ended().len()), (1, 0), "said once, though a wrap is refused every 0.7 s");
    assert!(drive.session.note("x").contains("robot.odometry_modulus = 4096"));
    // Any other refusal names it, too.
    let mut drive = driven(Robot::pioneer_1());
    drive.robot.x_m += 0.7;
    drive.run(200 * MS);
    let refused = drive.events.iter().find(|event| matches!(event, Event::OdometryRefused { .. })).unwrap();
    assert!(refused.to_string().ends_with("robot.odometry_modulus is wrong"), "{refused}");
}

#[test]
fn damaged_packets_do_not_hide_the_right_modulus() {
    let mut drive = driven(Robot { modulus: 4096, ..Robot::pioneer_1() });
    for _ in 0..60 {
        drive.run(500 * MS);
        let damaged = psos::Sip { x: drive.robot.sip().x ^ 0x0800, y: 2000, ..drive.robot.sip() };
        drive.step(stillmap_pioneer::Input::Bytes(&damaged.encode().unwrap()));
    }
    assert!(drive.conditions().contains(&(Condition::Odometry, "ODOMETRY REFUSED: set robot.odometry_modulus = 4096")));
    assert_eq!(drive.ended(), []);
}

#[test]
fn a_modulus_that_explains_nothing_any_more_is_over() {
    let mut drive = driven(Robot { modulus: 4096, ..Robot::pioneer_1() });
    assert_eq!(drive.ended(), []);
    drive.robot.m_per_cycle = 0.0;
    drive.run(20 * S);
    assert_eq!(drive.ended(), [Condition::Odometry]);
}
