//! Drives among walls by odometry that drifts.

#![allow(clippy::unwrap_used, clippy::panic, reason = "tests fail by panicking")]

mod scene;

use std::collections::BTreeMap;

use messages::Pose;
use scene::{Drive, Scene, Wheels, apart, around_block, block};
use stillmap_localisation::{Answer, Localisation, Parameters, RightAngles, Status};

const PARAMETERS: Parameters =
    Parameters { enabled: true, right_angles: RightAngles::Auto, half_beam_rad: 0.218, horizon_ns: 3_000_000_000 };
const DRIFTING: Wheels = Wheels { distance_share: 0.02, turn_share: 0.04, curvature_rad_m: 0.01 };

fn step(localisation: &mut Localisation, drive: &Drive, k: usize) -> Answer {
    localisation.step(k as u64, k as u64 * 100_000_000, &drive.scans[k])
}

/// Every answer; the last is that of the end.
fn answers(localisation: &mut Localisation, drive: &Drive) -> Vec<Answer> {
    let mut answers: Vec<Answer> = (0..drive.scans.len()).map(|k| step(localisation, drive, k)).collect();
    answers.push(localisation.finish());
    answers
}

/// The poses that a consumer has in the end.
fn final_poses(answers: &[Answer]) -> Vec<Pose> {
    let mut poses: BTreeMap<u64, Pose> = BTreeMap::new();
    for answer in answers {
        for moved in answer.revision.iter().flat_map(|revision| &revision.moved) {
            let motion = moved.now.then(&moved.before.inverse()).to_wire();
            assert!((moved.first..=moved.last).all(|seq| poses.contains_key(&seq)), "a revision moves what was answered");
            poses.range_mut(moved.first..=moved.last).for_each(|(_, pose)| *pose = motion.then(pose));
        }
        poses.extend(answer.smoothed.iter().map(|it| (it.seq, it.map_from_robot.to_wire())));
    }
    poses.into_values().collect()
}

fn odometry(drive: &Drive) -> Vec<Pose> {
    drive.scans.iter().map(|scan| scan.pose).collect()
}

#[test]
fn a_corridor_keeps_the_heading_that_the_wheels_lose() {
    let corridor = Scene(vec![[[-1.0, 1.0], [20.0, 1.0]], [[-1.0, -1.0], [20.0, -1.0]]]);
    let drive = corridor.drive(&[[0.0, 0.0], [15.0, 0.0]], Wheels { curvature_rad_m: 0.02, ..Wheels::default() });
    let mut localisation = Localisation::new(PARAMETERS).unwrap();
    let answers = answers(&mut localisation, &drive);
    assert!(apart(&odometry(&drive), &drive.truth).1 > 0.14, "the wheels turn by 0.3 rad");
    let (distance_m, heading_rad) = apart(&final_poses(&answers), &drive.truth);
    assert!(distance_m < 0.06 && heading_rad < 0.01, "{distance_m} m, {heading_rad} rad");
    assert_eq!(answers[drive.scans.len() - 1].status, Status::Tracking);
    assert_eq!(localisation.walls().count(), 2);
}

#[test]
fn a_loop_is_closed_and_the_wheels_are_calibrated() {
    let drive = block().drive(&around_block(6.0), DRIFTING);
    let mut localisation = Localisation::new(PARAMETERS).unwrap();
    let answers = answers(&mut localisation, &drive);
    assert!(apart(&odometry(&drive), &drive.truth).0 > 1.0, "odometry is metres off");
    let (distance_m, heading_rad) = apart(&final_poses(&answers), &drive.truth);
    assert!(distance_m < 0.1 && heading_rad < 0.01, "{distance_m} m, {heading_rad} rad");
    assert!(localisation.closures().any(|closure| closure.weight > 0.9));
    let found = localisation.calibration();
    assert!((found.turn_share - 0.04).abs() < 0.01 && (found.distance_share - 0.02).abs() < 0.005, "{found:?}");
    let numbers: Vec<u32> = answers.iter().filter_map(|answer| Some(answer.revision.as_ref()?.number)).collect();
    assert_eq!(numbers, (1..=numbers.len() as u32).collect::<Vec<_>>());
}

#[test]
fn every_scan_is_answered_once_and_in_order() {
    let drive = block().drive(&around_block(2.0), DRIFTING);
    let answers = answers(&mut Localisation::new(PARAMETERS).unwrap(), &drive);
    let numbers: Vec<u64> = answers.iter().flat_map(|answer| &answer.smoothed).map(|it| it.seq).collect();
    assert_eq!(numbers, (0..drive.scans.len() as u64).collect::<Vec<_>>());
}

#[test]
fn a_restart_at_any_scan_changes_no_answer() {
    let drive = block().drive(&around_block(6.0), DRIFTING);
    let expected = answers(&mut Localisation::new(PARAMETERS).unwrap(), &drive);
    let mut localisation = Localisation::new(PARAMETERS).unwrap();
    let (end, of_scans) = expected.split_last().unwrap();
    for (k, answer) in of_scans.iter().enumerate() {
        assert_eq!(step(&mut localisation, &drive, k), *answer, "scan {k}");
        // Every seventh scan, and every scan while the loop is being closed.
        if k % 7 == 0 || answer.revision.is_some() || k > drive.scans.len() - 120 {
            let bytes = localisation.to_bytes();
            localisation = Localisation::from_bytes(PARAMETERS, &bytes).unwrap();
            assert!(localisation.to_bytes() == bytes, "the state after scan {k}");
        }
    }
    assert_eq!(localisation.finish(), *end);
}

#[test]
fn at_rest_the_state_does_not_grow() {
    let mut drive = block().drive(&around_block(0.5), DRIFTING);
    let last = *drive.scans.last().unwrap();
    let mut localisation = Localisation::new(PARAMETERS).unwrap();
    let moving = drive.scans.len();
    drive.scans.extend([last; 400]);
    (0..moving + 200).for_each(|k| {
        step(&mut localisation, &drive, k);
    });
    let (bytes, answer) = (localisation.to_bytes().len(), step(&mut localisation, &drive, moving + 200));
    for k in moving + 201..moving + 400 {
        assert_eq!(step(&mut localisation, &drive, k).map_from_odom, answer.map_from_odom);
    }
    assert_eq!(localisation.to_bytes().len(), bytes);
}
