//! The robot's end of the line against recorded clients, broken clients, and any bytes at all.
#![expect(clippy::unwrap_used, reason = "tests fail by panicking")]

use messages::Pose;
use proptest::prelude::*;
use psos::{Command, Deframer, Identity, Model, Sip, number};
use stillmap_simulator::{Body, Packet, Reading, RobotEnd};

/// No bytes at all.
const NOTHING: [u8; 0] = [];

fn recording(name: &str) -> Vec<u8> {
    std::fs::read(format!("{}/../../tests/data/pioneer/{name}.bin", env!("CARGO_MANIFEST_DIR"))).unwrap()
}

fn robot(model: &str) -> RobotEnd {
    RobotEnd::new(&Body::of(Model::named(model).unwrap()), 32768, Pose::default())
}

fn packet(number: u64, x_m: f64) -> Packet {
    Packet {
        number,
        stamp_ns: number * 100_000_000,
        odometry: Pose { x_m, y_m: 0.0, yaw_rad: 0.0 },
        speed_m_s: 0.0,
        turn_rad_s: 0.0,
        readings: vec![Reading { sonar: 3, range_m: 1.87 }, Reading { sonar: 4, range_m: 5.0 }],
    }
}

/// The data of each packet.
fn packets(bytes: &[u8]) -> Vec<Vec<u8>> {
    Deframer::new().push(bytes).into_iter().map(|frame| frame.data).collect()
}

fn sip(bytes: &[u8]) -> Sip {
    Sip::decode(packets(bytes).first().unwrap()).unwrap()
}

fn say(robot: &mut RobotEnd, command: Command) -> Vec<u8> {
    robot.push(&command.encode().unwrap())
}

fn open(robot: &mut RobotEnd) {
    for step in [number::SYNC0, number::SYNC1, number::SYNC2, number::OPEN] {
        say(robot, Command::plain(step));
    }
    assert!(robot.is_open());
}

#[test]
fn the_handshake_is_answered_as_the_recorded_robot_does() {
    let recorded = packets(&recording("aria291-simpleConnect-pty_mobilesim-pion1x.s2c"));
    let mut robot = robot("pioneer-1");
    for (step, expected) in [number::SYNC0, number::SYNC1].into_iter().zip(&recorded) {
        assert_eq!(packets(&say(&mut robot, Command::plain(step))), std::slice::from_ref(expected));
    }
    let answer = packets(&say(&mut robot, Command::plain(number::SYNC2)));
    let (identity, recorded) = (Identity::decode(&answer[0]).unwrap(), Identity::decode(&recorded[2]).unwrap());
    assert_eq!(identity.class, recorded.class);
    assert_eq!(Model::of(&identity), Model::of(&recorded));
    assert!(!robot.is_open());
    assert_eq!(say(&mut robot, Command::plain(number::OPEN)), NOTHING);
    assert!(robot.is_open());
}

#[test]
fn recorded_clients_are_borne_however_their_bytes_are_cut() {
    for name in ["aria291-simpleConnect-pty_mobilesim-pion1x.c2s", "aria291-wander_mobilesim-pion1x.c2s"] {
        let sent = recording(name);
        for cut in [1, 2, 3, 7, 64, sent.len()] {
            let mut robot = robot("pioneer-1");
            let answers: Vec<u8> = sent.chunks(cut).flat_map(|bytes| robot.push(bytes)).collect();
            let answered: Vec<u8> = packets(&answers).iter().map(|data| data[0]).collect();
            assert_eq!(answered, [number::SYNC0, number::SYNC1, number::SYNC2], "{name} in pieces of {cut}: a Pioneer 1 has no CONFIG");
            assert_eq!(robot.line().bad_checksums, 0);
        }
    }
}

#[test]
fn a_recorded_session_opens_sends_and_closes() {
    let sent = recording("aria291-simpleConnect-pty_mobilesim-pion1x.c2s");
    assert_eq!(&sent[..5], b"WMS2\r", "junk before the handshake");
    let mut robot = robot("pioneer-1");
    // Each command is 6 to 9 bytes: up to but without the last one, CLOSE.
    robot.push(&sent[..sent.len() - 6]);
    assert!(robot.is_open());
    let status = sip(&robot.tick(&packet(1, 0.0)));
    assert_eq!(status.readings.len(), 2);
    assert_eq!(status.readings[0].range, 10784, "as the recorded robot, 1.87 m before a wall");
    robot.push(&sent[sent.len() - 6..]);
    assert!(!robot.is_open());
    assert_eq!(robot.tick(&packet(2, 0.0)), NOTHING);
}

#[test]
fn an_open_robot_reads_the_handshake_as_pulse_and_open() {
    let mut robot = robot("pioneer-1");
    open(&mut robot);
    assert_eq!(say(&mut robot, Command::plain(number::SYNC0)), NOTHING);
    assert_eq!(say(&mut robot, Command::plain(number::SYNC1)), NOTHING);
    assert!(!robot.tick(&packet(1, 0.0)).is_empty());
    say(&mut robot, Command::plain(number::CLOSE));
    assert!(!robot.is_open());
    open(&mut robot);
}

#[test]
fn open_and_close_before_the_handshake_have_no_effect() {
    let mut robot = robot("pioneer-1");
    for stray in [number::OPEN, number::CLOSE, number::SONAR, 255] {
        assert_eq!(say(&mut robot, Command::plain(stray)), NOTHING);
        assert!(!robot.is_open());
    }
    for step in [number::SYNC0, number::SYNC0, number::SYNC1, number::SYNC1, number::SYNC2] {
        assert!(!say(&mut robot, Command::plain(step)).is_empty(), "a client that missed an answer asks again");
    }
    say(&mut robot, Command::int(number::OPEN, 1));
    assert!(robot.is_open());
}

#[test]
fn a_synchronised_robot_answers_nothing_until_it_is_closed() {
    for end in [number::SYNC2, number::CLOSE] {
        let mut robot = robot("pioneer-1");
        for step in [number::SYNC0, number::SYNC1, number::SYNC2] {
            assert!(!say(&mut robot, Command::plain(step)).is_empty());
        }
        assert_eq!(say(&mut robot, Command::plain(number::SYNC0)), NOTHING, "it is PULSE now");
        assert_eq!(say(&mut robot, Command::plain(end)), NOTHING, "it is CLOSE now");
        open(&mut robot);
    }
}

#[test]
fn a_packet_with_any_flipped_bit_is_dropped_in_silence() {
    let sync = Command::plain(number::SYNC0).encode().unwrap();
    for bit in 0..sync.len() * 8 {
        let mut broken = sync.clone();
        broken[bit / 8] ^= 1 << (bit % 8);
        assert_eq!(robot("pioneer-1").push(&broken), NOTHING, "bit {bit}");
    }
}

#[test]
fn position_counters_wrap_and_seto_sets_them_to_zero() {
    let mut robot = robot("pioneer-1");
    open(&mut robot);
    let units = |x_m: f64| (x_m * 1000.0 / 0.05066).round() as i64;
    for x_m in [0.1, 1.65, 1.67, 5.0, -0.1] {
        assert_eq!(i64::from(sip(&robot.tick(&packet(1, x_m))).x), units(x_m).rem_euclid(32768), "{x_m} m");
    }
    robot.tick(&packet(2, 5.0));
    robot.push(&[0xFA, 0xFB, 4, 7, 0x3B, 7, 0x3B]);
    assert_eq!(sip(&robot.tick(&packet(3, 5.0))).x, 0);
    assert_eq!(i64::from(sip(&robot.tick(&packet(4, 5.5))).x), units(0.5));
}

#[test]
fn a_robot_switched_on_in_mid_drive_counts_from_there() {
    let here = Pose { x_m: 3.0, y_m: 1.0, yaw_rad: std::f64::consts::FRAC_PI_2 };
    let mut robot = RobotEnd::new(&Body::of(Model::named("p3-dx").unwrap()), 65536, here);
    open(&mut robot);
    let there = Packet { odometry: Pose { y_m: 2.0, ..here }, ..packet(1, 0.0) };
    let status = sip(&robot.tick(&there));
    assert_eq!((status.x, status.y, status.heading), (2062, 0, 0), "1 m ahead, in units of 0.485 mm");
}

#[test]
fn headings_run_from_minus_half_a_turn_to_half_a_turn() {
    let mut robot = robot("pioneer-1");
    open(&mut robot);
    for (turns, units) in [(0.0, 0), (0.25, 256), (0.499, 511), (0.5, -512), (0.75, -256), (1.0, 0), (-1.25, -256), (7.25, 256)] {
        let turned = Packet { odometry: Pose { yaw_rad: turns * std::f64::consts::TAU, ..Pose::default() }, ..packet(1, 0.0) };
        assert_eq!(sip(&robot.tick(&turned)).heading, units, "{turns} turns");
    }
}

#[test]
fn motion_shows_in_the_type_and_the_wheels() {
    let mut robot = robot("pioneer-1");
    open(&mut robot);
    let moving = Packet { speed_m_s: 0.25, turn_rad_s: 0.5, ..packet(1, 0.0) };
    let bytes = robot.tick(&moving);
    assert_eq!(bytes[3], psos::MOVING);
    let status = sip(&bytes);
    // 250 ∓ 200 × 0.5 mm/s in units of 2.5332.
    assert_eq!((status.left_velocity, status.right_velocity), (59, 138));
    assert_eq!(robot.tick(&packet(2, 0.0))[3], psos::STOPPED);
}

#[test]
fn motion_commands_and_a_dead_client_change_nothing() {
    let mut robot = robot("pioneer-1");
    open(&mut robot);
    for (motion, argument) in [(number::VEL, 400), (number::RVEL, -30), (number::E_STOP, 0), (99, 1)] {
        assert_eq!(say(&mut robot, Command::int(motion, argument)), NOTHING);
    }
    for tick in 1..=20 {
        assert!(!robot.tick(&packet(tick, 0.0)).is_empty());
        assert!(!robot.client_is_silent(), "after {tick} tenths of a second");
    }
    assert!(!robot.tick(&packet(21, 0.0)).is_empty());
    assert!(robot.client_is_silent());
    say(&mut robot, Command::plain(number::PULSE));
    assert!(!robot.client_is_silent());
}

/// The subclass by which a simulated robot of this model names itself.
fn subclass(model: &str) -> String {
    let mut robot = robot(model);
    let answers = [number::SYNC0, number::SYNC1, number::SYNC2].map(|step| say(&mut robot, Command::plain(step)));
    Identity::decode(&packets(&answers[2])[0]).unwrap().subclass
}

#[test]
fn robots_name_themselves_as_real_ones_do() {
    let named = ["pioneer-1", "pioneer-at", "p2-dx", "p3-dx", "p3-at", "amigobot", "patrolbot"].map(subclass);
    assert_eq!(named, ["pion1m", "pionat", "p2dx", "p3dx", "p3at", "amigo", "patrolbot-sh"]);
}

#[test]
fn p2os_packets_have_the_tail_of_the_recorded_robot() {
    let recorded = recording("raw-sync-while-open_mobilesim.s2c");
    let recorded = packets(&recorded).iter().find_map(|data| Sip::decode(data).ok()).unwrap();
    let mut robot = robot("p3-dx");
    open(&mut robot);
    let turning = Packet { turn_rad_s: -0.5, ..packet(1, 0.0) };
    let tail = sip(&robot.tick(&turning)).tail;
    assert_eq!(tail.len(), recorded.tail.len());
    assert_eq!(u16::from_le_bytes([tail[5], tail[6]]), 126, "battery, 0.1 V");
    assert_eq!(i16::from_le_bytes([tail[8], tail[9]]), -286, "turn rate, 0.1 deg/s");
    assert_eq!(tail[7..8], recorded.tail[7..8], "charge state");
    assert_eq!(tail[10..], recorded.tail[10..], "faults, sideways speed, temperature, state of charge");
}

#[test]
fn psos_packets_end_after_five_bytes() {
    let mut robot = robot("pioneer-1");
    open(&mut robot);
    assert_eq!(sip(&robot.tick(&packet(700, 0.0))).tail, [0x70, 0x11, 0, 0, 0], "70 s modulo 65.536 s");
}

#[test]
fn sonars_can_be_switched_off_and_p2os_says_so() {
    let mut robot = robot("p3-dx");
    open(&mut robot);
    assert!(sip(&robot.tick(&packet(1, 0.0))).sonars_on());
    say(&mut robot, Command::int(number::SONAR, 0));
    let status = sip(&robot.tick(&packet(2, 0.0)));
    assert!(status.readings.is_empty() && !status.sonars_on() && !robot.sonars_on());
    say(&mut robot, Command::int(number::SONAR, 1));
    assert_eq!(sip(&robot.tick(&packet(3, 0.0))).readings.len(), 2);
    say(&mut robot, Command::int(number::ENABLE, 1));
    assert!(sip(&robot.tick(&packet(4, 0.0))).motors_on());
}

#[test]
fn p2os_answers_config_as_the_recorded_robot_does() {
    let mut robot = robot("p2-dx");
    open(&mut robot);
    let answer = packets(&say(&mut robot, Command::plain(number::CONFIG)));
    let recorded = packets(&recording("aria291-wander_mobilesim-pion1x.s2c"));
    let recorded = recorded.iter().find(|data| data[0] == 0x20).unwrap();
    let (ours, theirs) = (fields(&answer[0]), fields(recorded));
    assert_eq!(ours.texts[..2], ["Pioneer", "p2dx"]);
    assert_eq!(theirs.texts[..2], ["Pioneer", "pion1x"]);
    // The watchdog, 2000 ms, stands at the same place after the texts.
    assert_eq!(ours.watchdog_ms, 2000);
    assert_eq!(theirs.watchdog_ms, 2000);
}

struct Fields {
    texts: Vec<String>,
    watchdog_ms: u16,
}

/// Three texts, 11 bytes, the name, then the watchdog after 14 bytes.
fn fields(data: &[u8]) -> Fields {
    let mut rest = &data[1..];
    let mut texts = Vec::new();
    for text in 0..4 {
        let end = rest.iter().position(|byte| *byte == 0).unwrap();
        texts.push(String::from_utf8(rest[..end].to_vec()).unwrap());
        rest = &rest[end + 1..];
        if text == 2 {
            rest = &rest[11..];
        }
    }
    Fields { texts, watchdog_ms: u16::from_le_bytes([rest[12], rest[13]]) }
}

proptest! {
    #[test]
    fn any_bytes_are_borne_and_a_client_gets_through_after_them(junk: Vec<u8>, model in 0_usize..5) {
        let mut robot = RobotEnd::new(&Body::of(&psos::MODELS[model]), 4096, Pose::default());
        robot.push(&junk);
        say(&mut robot, Command::plain(number::CLOSE));
        open(&mut robot);
        prop_assert_eq!(sip(&robot.tick(&packet(1, 2.0))).readings.len(), if robot.sonars_on() { 2 } else { 0 });
    }

    #[test]
    fn any_commands_are_borne(commands in prop::collection::vec((any::<u8>(), -70000_i32..70000), 0..60)) {
        let mut robot = robot("p3-dx");
        for (number, argument) in commands {
            let argument = if argument % 3 == 0 { Command::plain(number) } else { Command::int(number, argument) };
            say(&mut robot, argument);
            let status = robot.tick(&packet(1, 1.0));
            prop_assert_eq!(status.is_empty(), !robot.is_open());
        }
    }

    #[test]
    fn any_numbers_fit_into_a_packet(x_m in -1e6..1e6, y_m in -1e6..1e6, yaw_rad in -1e3..1e3, speed_m_s in -1e3..1e3, turn_rad_s in -1e3..1e3) {
        let mut robot = robot("pioneer-at");
        open(&mut robot);
        let far = Packet { odometry: Pose { x_m, y_m, yaw_rad }, speed_m_s, turn_rad_s, ..packet(9, 0.0) };
        let status = sip(&robot.tick(&far));
        prop_assert!(status.x < 32768 && status.y < 32768 && (-512..512).contains(&status.heading));
    }
}
