//! Finding a robot, keeping it, and losing it: scripted, in virtual time.
#![allow(clippy::unwrap_used, clippy::float_cmp, reason = "tests fail by panicking")]

mod support;

use messages::{AFTER_DOUBT, AFTER_LOSS};
use psos::number;
use stillmap_pioneer::{Condition, Doubt, Event, Input};
use support::{Drive, MS, Robot, S};

fn connected(drive: &Drive) -> usize {
    drive.events.iter().filter(|event| matches!(event, Event::Connected { .. })).count()
}

#[test]
fn a_closed_robot_is_opened_and_scans_come() {
    let mut drive = Drive::new(Robot::pioneer_1());
    drive.run(10 * S);
    assert_eq!(drive.robot.received[..4], [number::SYNC0, number::SYNC1, number::SYNC2, number::OPEN]);
    assert_eq!(drive.events.len(), 1, "{:?}", drive.events);
    assert!((97..=100).contains(&drive.scans.len()), "{}", drive.scans.len());
    drive.check_stream();
    let first = &drive.scans[0];
    assert_eq!((first.seq, first.scan.after_gap, first.scan.pose.x_m), (1, 0, 0.0), "the pose starts at identity");
    assert!(drive.scans.iter().all(|saved| saved.scan.after_gap == 0));
    let travelled = 0.03 * (drive.scans.len() - 1) as f64;
    assert!((drive.pose_x_m() - travelled).abs() < 1e-3, "{} of {travelled} m", drive.pose_x_m());
    assert_eq!(drive.session.note("/dev/pioneer"), "pioneer-1 at 9600 baud, battery 13.1 V, a packet every 100 ± 0 ms");
}

#[test]
fn a_pulse_comes_twice_a_second_and_psos_hears_nothing_it_lacks() {
    let mut drive = Drive::new(Robot::pioneer_1());
    drive.run(10 * S);
    let pulses = drive.robot.received[4..].iter().filter(|&&received| received == number::PULSE).count();
    assert!((18..=20).contains(&pulses), "{pulses}");
    assert_eq!(drive.robot.received.len(), 4 + pulses, "{:?}", drive.robot.received);
}

#[test]
fn the_baud_rate_is_searched() {
    for baud in [9600, 38400, 19200, 115_200, 57600] {
        let mut drive = Drive::new(Robot { baud, ..Robot::pioneer_1() });
        drive.run(7 * S);
        assert!(matches!(&drive.events[..], [Event::Connected { baud: found, .. }] if *found == baud), "{:?}", drive.events);
        drive.check_stream();
    }
}

#[test]
fn no_robot_is_said() {
    let mut drive = Drive::new(Robot { baud: 300, ..Robot::pioneer_1() });
    drive.run(30 * S);
    assert_eq!(drive.events, [1, 2, 4].map(|rounds| Event::NoAnswer { rounds }));
    assert!(drive.session.note("/dev/pioneer").starts_with("no robot answers on /dev/pioneer; trying"));
    drive.robot.baud = 19200;
    drive.run(7 * S);
    assert!(matches!(drive.events.last(), Some(Event::Connected { baud: 19200, .. })));
}

#[test]
fn a_robot_left_open_is_closed_first() {
    let mut drive = Drive::new(Robot { open: true, ..Robot::pioneer_1() });
    drive.run(5 * S);
    assert!(matches!(&drive.events[..], [Event::AlreadyOpen { closings: 1 }, Event::Connected { .. }]), "{:?}", drive.events);
    assert!(drive.scans.len() > 30);
    assert_eq!(drive.scans[0].scan.after_gap, 0, "nothing of this stream was lost");
    drive.check_stream();
}

#[test]
fn a_robot_synchronised_but_never_opened_is_closed_and_opened() {
    for baud in [9600, 115_200] {
        let mut drive = Drive::new(Robot { baud, named: true, ..Robot::pioneer_1() });
        drive.run(13 * S);
        assert_eq!(connected(&drive), 1, "{baud}: {:?}", drive.events);
        drive.check_stream();
    }
}

#[test]
fn a_lost_identity_is_asked_for_again_at_the_same_baud_rate() {
    let mut drive = Drive::new(Robot::pioneer_1());
    let mut answers = 0;
    // The answers to SYNC0 and SYNC1 pass, that to SYNC2 is lost: the robot is left synchronised.
    drive.damage = Box::new(move |bytes| {
        answers += u32::from(!bytes.is_empty());
        if answers == 3 && !bytes.is_empty() { Vec::new() } else { bytes }
    });
    drive.run(3 * S);
    assert!(matches!(&drive.events[..], [Event::Connected { baud: 9600, .. }]), "{:?}", drive.events);
    assert_eq!(drive.robot.received[3..5], [number::CLOSE, number::SYNC0]);
}

#[test]
fn an_echo_is_no_robot_and_is_named() {
    let mut drive = Drive::new(Robot::pioneer_1());
    drive.echo = true;
    drive.run(30 * S);
    assert_eq!(connected(&drive), 0);
    let echoes: Vec<_> = drive.events.iter().filter(|event| matches!(event, Event::NotARobot { echo: true, .. })).collect();
    assert_eq!(echoes.len(), 5, "1st, 2nd, 4th, 8th, 16th: {:?}", drive.events);
    assert_eq!(drive.session.note("/dev/x"), "/dev/x sends back what is sent to it: it is not a robot");
    drive.echo = false;
    drive.run(8 * S);
    assert_eq!(connected(&drive), 1);
}

#[test]
fn an_answer_without_names_is_no_robot() {
    let mut drive = Drive::new(Robot { nameless: true, ..Robot::pioneer_1() });
    drive.run(10 * S);
    assert_eq!(connected(&drive), 0);
    assert!(drive.events.contains(&Event::NotARobot { echo: false, times: 1 }), "{:?}", drive.events);
}

#[test]
fn a_robot_that_boots_on_open_is_found_in_the_second_round() {
    let mut drive = Drive::new(Robot { unresponsive: true, ..Robot::pioneer_1() });
    drive.run(2500 * MS);
    drive.robot.unresponsive = false;
    drive.run(6 * S);
    assert_eq!(connected(&drive), 1, "{:?}", drive.events);
}

#[test]
fn a_robot_that_hears_nothing_does_not_fill_the_log() {
    let mut drive = Drive::new(Robot { open: true, ..Robot::pioneer_1() });
    drive.robot.unresponsive = true;
    drive.run(30 * S);
    let said: Vec<_> = [1, 2, 4, 8, 16, 32].map(|closings| Event::AlreadyOpen { closings }).into();
    assert!(drive.events.len() >= 5 && said.starts_with(&drive.events), "{:?}", drive.events);
    drive.robot.unresponsive = false;
    drive.run(3 * S);
    assert_eq!(connected(&drive), 1);
}

#[test]
fn sonars_are_asked_for_until_they_fire() {
    let mut drive = Drive::new(Robot::p3_dx());
    drive.run(2 * S);
    assert!(drive.robot.sonars);
    let asked = |drive: &Drive| drive.robot.received.iter().filter(|&&received| received == number::SONAR).count();
    assert_eq!(asked(&drive), 1);
    assert_eq!(drive.conditions(), []);
    // Another program, or a fault, switches them off; the robot is unresponsive to the command for a while.
    drive.robot.has_sonar_command = false;
    drive.robot.sonars = false;
    drive.run(6 * S);
    assert!((4..=6).contains(&asked(&drive)), "{}", asked(&drive));
    assert_eq!(drive.conditions(), [(Condition::NoReadings, "NO SONAR READINGS for 2 s")]);
    drive.robot.has_sonar_command = true;
    drive.run(2 * S);
    assert!(drive.robot.sonars);
    let before = asked(&drive);
    drive.run(5 * S);
    assert_eq!(asked(&drive), before);
}

#[test]
fn another_model_than_in_the_settings_uses_its_own_factors() {
    let mut drive = Drive::new(Robot::p3_dx());
    drive.run(5 * S);
    assert!(drive.events.contains(&Event::OtherModel { settings: "pioneer-1", found: "p3-dx" }));
    let saved = drive.scans.last().unwrap();
    assert_eq!(saved.scan.readings()[0].range_m, 1.0, "1000 units of 1 mm");
    assert_eq!(saved.scan.readings()[0].mount.y_m, 0.027);
    assert!((saved.scan.pose.x_m - 0.03 * (saved.seq - 1) as f64).abs() < 1e-3);
}

#[test]
fn an_unknown_robot_is_shouted_about() {
    let mut drive = Drive::new(Robot { subclass: "wheelbarrow", ..Robot::pioneer_1() });
    drive.run(3 * S);
    assert!(drive.events.contains(&Event::UnknownModel { subclass: "wheelbarrow".into(), settings: "pioneer-1" }));
    assert!(drive.session.note("x").starts_with("UNKNOWN ROBOT \"wheelbarrow\" taken for a pioneer-1"), "{}", drive.session.note("x"));
}

#[test]
fn a_silent_link_is_lost_after_eight_seconds_and_resumed() {
    let mut drive = Drive::new(Robot::p3_dx());
    drive.run(5 * S);
    let before = drive.scans.len();
    drive.quiet = true;
    drive.run(7900 * MS);
    assert!(!drive.events.iter().any(|event| matches!(event, Event::LinkLost { .. })));
    drive.run(300 * MS);
    assert!(drive.events.iter().any(|event| matches!(event, Event::LinkLost { silence_s, damaged: 0 } if (*silence_s - 8.0).abs() < 0.2)));
    drive.quiet = false;
    drive.run(10 * S);
    assert_eq!((connected(&drive), drive.session.reconnects()), (1, 1), "its session continued: {:?}", drive.events);
    assert_eq!(drive.scans[before].scan.after_gap, AFTER_LOSS);
    assert!((drive.pose_x_m() - 0.03 * (drive.scans.len() as f64 + 82.0 - 1.0)).abs() < 0.04, "the counters tell where it went");
    assert!(drive.scans[before + 1..].iter().all(|saved| saved.scan.after_gap == 0));
    drive.check_stream();
}

#[test]
fn packets_that_vanish_without_a_trace_are_a_gap_too() {
    let mut drive = Drive::new(Robot::pioneer_1());
    drive.run(3 * S);
    let before = drive.scans.len();
    drive.quiet = true;
    drive.run(600 * MS);
    drive.quiet = false;
    drive.run(S);
    let gaps: Vec<_> = drive.scans.iter().filter(|saved| saved.scan.after_gap == 1).map(|saved| saved.seq).collect();
    assert_eq!(gaps, [before as u64 + 1]);
    assert!((drive.pose_x_m() - 0.03 * (drive.scans.len() + 6 - 1) as f64).abs() < 1e-3, "{}", drive.pose_x_m());
    drive.check_stream();
}

#[test]
fn a_robot_restarted_without_its_adapter_counts_anew() {
    let mut drive = Drive::new(Robot::pioneer_1());
    drive.run(5 * S);
    let (before, pose) = (drive.scans.len(), drive.pose_x_m());
    drive.plugged = false;
    drive.run(S);
    drive.robot = Robot { next_sip_ns: drive.now_ns, ..Robot::pioneer_1() };
    drive.plugged = true;
    drive.run(5 * S);
    assert_eq!(connected(&drive), 2, "{:?}", drive.events);
    assert_eq!((drive.scans[before].scan.after_gap, drive.scans[before].scan.pose.x_m), (AFTER_DOUBT, pose));
    drive.check_stream();
}

#[test]
fn a_robot_switched_off_and_on_is_noticed_by_its_echo() {
    let mut drive = Drive::new(Robot::pioneer_1());
    drive.run(5 * S);
    let before = drive.scans.len();
    drive.robot = Robot::pioneer_1();
    drive.run(4 * S);
    assert!(drive.events.contains(&Event::RobotRestarted), "{:?}", drive.events);
    assert_eq!(connected(&drive), 2);
    assert_eq!(drive.scans[before].scan.after_gap, AFTER_DOUBT);
    assert!(matches!(drive.events.last(), Some(Event::PoseDoubtful { doubt: Doubt::Restarted { .. } })), "{:?}", drive.events);
    drive.check_stream();
}

#[test]
fn a_killed_driver_takes_up_the_session() {
    let mut drive = Drive::new(Robot { baud: 38400, ..Robot::pioneer_1() });
    drive.run(6 * S);
    let saved = *drive.scans.last().unwrap();
    // Half a second later another process has started. The robot was never closed.
    let mut robot = drive.robot;
    let later_ns = drive.now_ns + 500 * MS;
    robot.speak(later_ns);
    robot.received.clear();
    let mut next = Drive::going_on(robot, Some(saved), later_ns);
    next.run(3 * S);
    assert!(matches!(&next.events[..], [Event::Resumed { baud: 38400, .. }]), "{:?}", next.events);
    assert!(next.robot.received.iter().all(|&received| received == number::PULSE), "no handshake: {:?}", next.robot.received);
    let first = next.scans[0];
    assert_eq!((first.seq, first.scan.after_gap), (saved.seq + 1, 1));
    assert!((first.scan.pose.x_m - saved.scan.pose.x_m - 0.18).abs() < 1e-3, "what the robot drove meanwhile is not lost");
    assert!((next.pose_x_m() - 0.03 * (next.scans.len() as f64 + 5.0) - saved.scan.pose.x_m).abs() < 1e-3);
    next.check_stream();
}

#[test]
fn a_robot_closed_since_the_checkpoint_is_opened_again() {
    let mut drive = Drive::new(Robot::pioneer_1());
    drive.run(4 * S);
    let saved = *drive.scans.last().unwrap();
    let mut next = Drive::going_on(Robot { x_m: 77.7, ..Robot::pioneer_1() }, Some(saved), drive.now_ns + S);
    next.run(4 * S);
    assert!(matches!(&next.events[..], [Event::Connected { .. }, Event::PoseDoubtful { .. }]), "{:?}", next.events);
    let first = next.scans[0];
    assert_eq!((first.seq, first.scan.after_gap, first.scan.pose), (saved.seq + 1, AFTER_DOUBT, saved.scan.pose));
    assert!(first.stamp_ns > saved.stamp_ns);
    next.check_stream();
}

#[test]
fn lost_answers_cost_time_only() {
    for lost in 0..4 {
        let mut drive = Drive::new(Robot::pioneer_1());
        let mut answers = 0;
        drive.damage = Box::new(move |bytes| {
            if bytes.is_empty() {
                return bytes;
            }
            answers += 1;
            if answers - 1 == lost { Vec::new() } else { bytes }
        });
        drive.run(12 * S);
        assert_eq!(drive.scans.last().map(|saved| saved.scan.count), Some(1), "lost {lost}: {:?}", drive.events);
    }
}

#[test]
fn an_open_that_is_lost_is_sent_again() {
    let mut drive = Drive::new(Robot { misses_open: true, ..Robot::pioneer_1() });
    drive.run(2 * S);
    assert!(drive.scans.len() >= 8, "{} {:?}", drive.scans.len(), drive.events);
    assert_eq!((connected(&drive), drive.events.len()), (1, 1), "{:?}", drive.events);
}

#[test]
fn limits_too_low_for_the_robot_are_reported_seldom() {
    let mut drive = Drive::new(Robot::p3_dx());
    drive.run(2 * S);
    let before = drive.scans.len();
    drive.robot.m_per_cycle = 0.3;
    drive.run(2 * S);
    assert_eq!(drive.scans.len(), before, "3 m/s is beyond the limit of 1 m/s");
    let limits = "20 packets in a row refused: are robot.odometry_modulus, pioneer.speed_limit_m_s and turn_limit_rad_s right?; ";
    assert!(drive.session.note("x").starts_with(limits) && limits.len() <= 128, "the status shows that much: {}", drive.session.note("x"));
    let said = drive.events.iter().filter(|event| matches!(event, Event::OdometryRefused { .. })).count();
    assert_eq!((drive.session.refusals().odometry, said), (20, 5));
}

#[test]
fn stopping_closes_the_robot() {
    let mut drive = Drive::new(Robot::pioneer_1());
    drive.run(3 * S);
    let scans = drive.scans.len();
    drive.step(Input::Stop);
    assert!(!drive.robot.open);
    assert_eq!(drive.robot.received.last(), Some(&number::CLOSE));
    drive.run(3 * S);
    assert_eq!(drive.scans.len(), scans);
}

#[test]
fn nothing_sent_in_any_of_this_moves_a_robot() {
    let allowed = [number::PULSE, number::OPEN, number::CLOSE, number::SONAR];
    for robot in [Robot::pioneer_1(), Robot::p3_dx(), Robot { open: true, ..Robot::p3_dx() }] {
        let mut drive = Drive::new(robot);
        for second in 0..60 {
            drive.quiet = second % 13 > 9;
            drive.plugged = second % 17 > 3;
            drive.run(S);
        }
        drive.step(Input::Stop);
        assert!(drive.sent.len() > 50);
        for packet in &drive.sent {
            let frame = psos::Deframer::new().push(packet).remove(0);
            assert!(allowed.contains(&frame.data[0]), "{packet:02X?}");
        }
        drive.check_stream();
    }
}
