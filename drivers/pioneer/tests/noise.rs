//! Garbage on the line costs packets, never the driver, and what a checksum lets through stays within bounds.
#![allow(clippy::unwrap_used, reason = "tests fail by panicking")]

mod support;

use messages::{AFTER_DOUBT, Payload, SonarScan};
use proptest::prelude::*;
use stillmap_pioneer::recording::decode;
use stillmap_pioneer::{Input, Output, Parameters, Session};
use support::{Drive, MS, Robot, S, recording};

/// Numbers that look random and are the same every time.
struct Dice(u64);

impl Dice {
    fn roll(&mut self) -> u64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        self.0
    }

    fn one_in(&mut self, many: u64) -> bool {
        self.roll().is_multiple_of(many)
    }
}

fn flip_bits(bytes: &mut [u8], dice: &mut Dice, one_in: u64) {
    for byte in bytes {
        for bit in 0..8 {
            if dice.one_in(one_in) {
                *byte ^= 1 << bit;
            }
        }
    }
}

fn way_m(scans: &[SonarScan]) -> Vec<(f64, f64)> {
    scans.iter().map(|scan| (scan.pose.x_m, scan.pose.y_m)).collect()
}

#[test]
fn a_bit_in_a_thousand_flipped_leaves_the_way_the_same() {
    let clean = recording("aria291-wander_mobilesim-pion1x.s2c.bin");
    let expect = way_m(&decode(&clean, &Parameters::default()).scans);
    let (mut scans, mut refused) = (0, 0);
    for seed in 1..=200 {
        let mut bytes = clean.clone();
        flip_bits(&mut bytes[105..], &mut Dice(seed), 1000);
        let found = decode(&bytes, &Parameters::default());
        scans += found.scans.len();
        refused += found.refusals.odometry;
        for scan in &found.scans {
            scan.validate().unwrap();
            let nearest = expect.iter().map(|p| (p.0 - scan.pose.x_m).hypot(p.1 - scan.pose.y_m)).fold(f64::MAX, f64::min);
            assert!(nearest < 0.1, "seed {seed}: {nearest} m off the way");
        }
        // The last packets of the recording may be among the damaged ones: up to 0.4 m/s.
        let (end, last) = (expect.last().unwrap(), found.scans.last().unwrap().pose);
        assert!((end.0 - last.x_m).hypot(end.1 - last.y_m) < 0.2, "seed {seed}: {last:?} instead of {end:?}");
    }
    // With 496 bits a packet, 61 % come through whole.
    assert!((0.55..0.68).contains(&(scans as f64 / (200.0 * 389.0))), "{scans}");
    assert!(refused > 0, "two flips in a column pass the checksum now and then");
}

#[test]
fn a_drive_through_noise_stays_connected_and_says_gaps() {
    let mut dice = Dice(42);
    let mut drive = Drive::new(Robot::pioneer_1());
    drive.damage = Box::new(move |mut bytes| {
        flip_bits(&mut bytes, &mut dice, 1000);
        if dice.one_in(20) {
            let cut = dice.roll() as usize % (bytes.len() + 1);
            bytes.truncate(cut);
        }
        if dice.one_in(10) {
            let noise = (0..dice.roll() % 100).map(|_| dice.roll() as u8);
            bytes.extend(noise);
        }
        bytes
    });
    while drive.scans.is_empty() {
        drive.run(100 * MS);
    }
    let start_m = drive.robot.x_m;
    drive.run(300 * S);
    drive.check_stream();
    assert!(drive.scans.len() > 1500, "{}", drive.scans.len());
    assert_eq!(drive.session.reconnects(), 0);
    let way_m = drive.robot.x_m - start_m;
    assert!((drive.pose_x_m() - way_m).abs() < 0.2, "{} of {way_m} m", drive.pose_x_m());
    let gaps = drive.scans.iter().filter(|saved| saved.scan.after_gap == 1).count();
    assert!(gaps > 300, "{gaps}");
    let link = drive.session.link();
    assert!(link.bad_checksums > 500 && link.skipped_bytes > 10_000, "{link:?}");
}

#[test]
fn after_the_noise_everything_is_as_before() {
    let mut drive = Drive::new(Robot::pioneer_1());
    drive.run(3 * S);
    let mut dice = Dice(7);
    drive.damage = Box::new(move |bytes| bytes.iter().map(|_| dice.roll() as u8).collect());
    drive.run(3 * S);
    drive.damage = Box::new(|bytes| bytes);
    let before = drive.scans.len();
    drive.run(5 * S);
    assert_eq!(drive.scans.len(), before + 50);
    assert_eq!(drive.scans[before].scan.after_gap, AFTER_DOUBT, "3 s are more than the counters of this robot bridge for sure");
    assert!(drive.scans[before + 1..].iter().all(|saved| saved.scan.after_gap == 0));
    let way_m = 0.03 * (drive.scans.len() + 30 - 1) as f64;
    assert!((drive.pose_x_m() - way_m).abs() < 1e-3, "what was driven in the noise is not lost: {} of {way_m} m", drive.pose_x_m());
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 256, ..ProptestConfig::default() })]

    #[test]
    fn no_bytes_at_any_time_harm(
        pieces in prop::collection::vec((prop::collection::vec(any::<u8>(), 0..200), 0_u64..3000), 0..40),
        from in 0_usize..24000,
    ) {
        let recorded = recording("aria291-wander_mobilesim-pion1x.s2c.bin");
        let mut session = Session::new(Parameters::default(), None);
        let mut now_ns = S;
        let _ = session.step(Input::Opened, now_ns);
        for (place, (bytes, wait_ms)) in pieces.iter().enumerate() {
            now_ns += wait_ms * MS;
            let good = &recorded[(from + 100 * place) % recorded.len()..];
            for input in [Input::Bytes(bytes), Input::Tick, Input::Bytes(&good[..good.len().min(200)]), Input::Tick] {
                for output in session.step(input, now_ns) {
                    match output {
                        Output::Publish(saved) => prop_assert!(saved.scan.validate().is_ok()),
                        Output::Event(event) => prop_assert!(!event.to_string().is_empty()),
                        Output::Reopen => {
                            let _ = session.step(Input::Opened, now_ns);
                        }
                        _ => {}
                    }
                }
            }
            prop_assert!(session.note("/dev/pioneer").len() < 200);
        }
    }
}
