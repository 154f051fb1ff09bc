//! Recorded sessions become the scans that their README states.
#![allow(clippy::unwrap_used, clippy::float_cmp, reason = "tests fail by panicking")]

mod support;

use messages::{Payload, SonarScan};
use psos::LinkCounters;
use stillmap_pioneer::recording::{Recording, decode};
use stillmap_pioneer::{Input, Output, Parameters, Refusals, Session};
use support::{MS, recording};

const WANDER: &str = "aria291-wander_mobilesim-pion1x.s2c.bin";
const REST: &str = "aria291-simpleConnect-pty_mobilesim-pion1x.s2c.bin";
const WHILE_OPEN: &str = "raw-sync-while-open_mobilesim.s2c.bin";

/// The recorded simulator's own limit is 3.5 m: above the default limit, so that its readings can be told apart.
fn far() -> Parameters {
    Parameters { range_limit_m: 3.6, ..Parameters::default() }
}

#[track_caller]
fn check_whole(recording: &Recording, scans: usize) {
    assert_eq!(recording.identity.as_ref().unwrap().subclass, "pion1x");
    assert_eq!(recording.scans.len(), scans);
    assert_eq!((recording.link.bad_checksums, recording.link.skipped_bytes), (0, 0));
    assert_eq!(recording.refusals, Refusals::default());
    for scan in &recording.scans {
        scan.validate().unwrap();
        assert_eq!(scan.after_gap, 0);
    }
}

#[test]
fn every_packet_of_the_recordings_is_a_scan() {
    check_whole(&decode(&recording(REST), &Parameters::default()), 32);
    check_whole(&decode(&recording(WANDER), &Parameters::default()), 389);
    let while_open = decode(&recording(WHILE_OPEN), &Parameters::default());
    check_whole(&while_open, 36);
    assert_eq!(while_open.scans.iter().filter(|scan| scan.count == 0).count(), 8, "SONAR 0: no readings");
}

#[test]
fn ranges_are_those_of_the_box() {
    let scans = decode(&recording(WANDER), &far()).scans;
    let ahead = scans[0].readings()[3];
    assert_eq!((ahead.sonar, ahead.echo), (3, 1));
    assert!((ahead.range_m - 1.870).abs() < 1e-4, "2000 mm less the sonar's own 130: {}", ahead.range_m);
    assert_eq!((ahead.mount.x_m, ahead.mount.y_m, ahead.mount.yaw_rad), (0.13, 0.0, 0.0));
    let farthest = scans.iter().flat_map(SonarScan::readings).map(|reading| reading.range_m).fold(0.0, f64::max);
    assert!((farthest - 20185.0 * 0.1734e-3).abs() < 1e-9, "{farthest}");
    assert!((farthest - 3.5).abs() < 1e-3);
}

#[test]
fn readings_beyond_the_limit_are_no_echo() {
    let scans = decode(&recording(WANDER), &Parameters::default()).scans;
    let readings: Vec<_> = scans.iter().flat_map(SonarScan::readings).collect();
    assert!(readings.iter().all(|reading| (reading.echo == 0) == (reading.range_m == 3.0)));
    assert!(readings.iter().any(|reading| reading.echo == 0));
    assert!(readings.iter().filter(|reading| reading.echo == 1).count() > 2000);
}

#[test]
fn a_robot_at_rest_stays_where_it_is() {
    for scan in decode(&recording(REST), &Parameters::default()).scans {
        assert_eq!(scan.pose, messages::Pose::default());
    }
}

/// The recording's y wraps at 16 bits, downwards (0 to 65517) and later upwards (65378 to 611): a modulus of 2^15 or 2^16
/// follows it, since a step is far below half of either.
#[test]
fn odometry_follows_both_wraps() {
    for odometry_modulus in [32768, 65536] {
        let scans = decode(&recording(WANDER), &Parameters { odometry_modulus, ..Parameters::default() }).scans;
        let steps = scans.windows(2).map(|pair| {
            let (before, after) = (pair[0].pose, pair[1].pose);
            (after.x_m - before.x_m).hypot(after.y_m - before.y_m)
        });
        let longest = steps.fold(0.0, f64::max);
        assert!((longest - 0.040).abs() < 1e-3, "0.4 m/s at 10 Hz: {longest}");
        assert!(scans[41].pose.y_m < 0.0 && scans[40].pose.y_m == 0.0, "{:?}", scans[41].pose);
        assert!(scans[302].pose.y_m < 0.0 && scans[303].pose.y_m > 0.0, "{:?} {:?}", scans[302].pose, scans[303].pose);
        // The way's end, from the counters unwound by hand: packet 388.
        let end = scans.last().unwrap().pose;
        let (x, y, heading) = WANDER_END;
        assert!((end.x_m - f64::from(x) * 0.05066e-3).abs() < 1e-9, "{end:?}");
        assert!((end.y_m - f64::from(y) * 0.05066e-3).abs() < 1e-9, "{end:?}");
        assert!((end.yaw_rad - f64::from(heading) * std::f64::consts::TAU / 1024.0).abs() < 1e-9, "{end:?}");
    }
}

/// x, y and heading of the wander recording's last packet, in units.
const WANDER_END: (i32, i32, i32) = (22109, 22345, 500);

/// The robot was in a box of 4 m by 3 m around its start: each beam ends within it, and some at each wall.
#[test]
fn poses_and_ranges_fit_together() {
    let (mut low, mut high) = ([f64::MAX; 2], [f64::MIN; 2]);
    for scan in decode(&recording(WANDER), &Parameters::default()).scans {
        for reading in scan.readings().iter().filter(|reading| reading.echo == 1) {
            let sonar = scan.pose.then(&reading.mount);
            let (sin, cos) = sonar.yaw_rad.sin_cos();
            for (axis, end) in [sonar.x_m + reading.range_m * cos, sonar.y_m + reading.range_m * sin].into_iter().enumerate() {
                low[axis] = low[axis].min(end);
                high[axis] = high[axis].max(end);
            }
        }
    }
    for (found, wall) in [(low[0], -2.0), (high[0], 2.0), (low[1], -1.5), (high[1], 1.5)] {
        assert!((found - wall).abs() < 0.04, "{low:?} {high:?}");
    }
}

/// The driver's own conversation ends where the recording's begins: the same scans, however the bytes come.
#[test]
fn a_session_fed_in_pieces_of_any_length_gives_the_same_scans() {
    let bytes = recording(WANDER);
    let expect = decode(&bytes, &Parameters::default()).scans;
    for length in (1..=64).chain([100, 1000, bytes.len()]) {
        let mut session = Session::new(Parameters::default(), None);
        let mut now_ns = 1_000_000 * MS;
        let mut scans = Vec::new();
        let _ = session.step(Input::Opened, now_ns);
        for piece in bytes.chunks(length) {
            // As if the line carried 930 bytes a second: fifteen packets, so that the one long packet makes no gap.
            now_ns += piece.len() as u64 * 1_000_000_000 / 930;
            for output in session.step(Input::Bytes(piece), now_ns) {
                if let Output::Publish(saved) = output {
                    scans.push(saved.scan);
                }
            }
        }
        assert_eq!(session.link(), LinkCounters { packets: 393, bad_checksums: 0, skipped_bytes: 0 });
        assert!(scans == expect, "pieces of {length}: {} scans of {}", scans.len(), expect.len());
    }
}
