//! What the bag of a log holds.

use std::path::Path;

use drivelog::{Log, Preamble, Recording};
use messages::{AFTER_LOSS, CameraFrame, FrameLayout, PixelFormat, Pose, RobotEstimate, SonarReading, SonarScan};

use crate::bag::Bag;
use crate::cdr;
use crate::export::{Sensors, export};
use crate::import::import;
use crate::interfaces::{TfMessage, name};
use crate::message::Topic;
use crate::survey::survey;

const MS: u64 = 1_000_000;

fn preamble() -> Preamble {
    let (robot, origin, sonars) = ("pioneer-1".to_owned(), "a test".to_owned(), vec![Pose::default()]);
    Preamble { run: 1, robot, sonars, origin, settings: "name = \"x\"\n".to_owned() }
}

fn scan(x_m: f64, mount: Pose) -> SonarScan {
    SonarScan::new(Pose::new(x_m, 0.0, 0.0), &[SonarReading::new(0, mount, 1.0, true)], false)
}

/// Exports what `record` records into the folder `bag`. Returns the lines about what is not carried.
fn exported(folder: &Path, is_localised: bool, record: impl FnOnce(&mut Recording)) -> Vec<String> {
    let mut recording = Recording::new(&preamble()).unwrap();
    record(&mut recording);
    let [log, bag] = ["log.mcap", "bag"].map(|name| folder.join(name));
    std::fs::write(&log, recording.finish().unwrap()).unwrap();
    let sensors = Sensors {
        sonars: preamble().sonars,
        max_range_m: 3.0,
        field_of_view_rad: 0.4,
        camera: Pose::default(),
        camera_height_m: 0.3,
        camera_field_of_view_rad: 1.0,
        horizon_share: 0.5,
        is_localised,
    };
    export(&mut Log::open(&log).unwrap(), &sensors, &bag).unwrap().left_out
}

/// The transforms from `map` on this topic: stamp in ms and x.
fn map_from_odom(folder: &Path, topic: &str) -> Vec<(u64, f64)> {
    let mut found = Vec::new();
    let wants = |found: &Topic| found.type_name == name::TF && found.name == topic;
    let bag = Bag::open(&folder.join("bag")).unwrap();
    bag.visit(&wants, &mut |message| {
        for transform in cdr::decode::<TfMessage>(&message.data().unwrap()).unwrap().transforms {
            if transform.header.frame_id == "map" {
                assert_eq!(transform.child_frame_id, "odom");
                found.push((transform.header.stamp.ns() / MS, transform.transform.position.x));
            }
        }
        Ok(())
    })
    .unwrap();
    found
}

#[test]
fn what_localisation_estimates_is_in_the_transforms() {
    let record = |recording: &mut Recording| {
        for seq in 1..=3 {
            recording.scan(seq, seq * 100 * MS, &scan(0.0, Pose::default())).unwrap();
            let estimate = RobotEstimate { map_from_odom: Pose::new(seq as f64, 0.0, 0.0), ..RobotEstimate::default() };
            recording.add(seq, seq * 100 * MS, &estimate).unwrap();
        }
    };
    let folder = tempfile::tempdir().unwrap();
    exported(folder.path(), true, record);
    assert_eq!(map_from_odom(folder.path(), "/tf"), [(100, 1.0), (200, 2.0), (300, 3.0)]);
    assert_eq!(map_from_odom(folder.path(), "/tf_static"), []);
    let folder = tempfile::tempdir().unwrap();
    exported(folder.path(), false, record);
    assert_eq!(map_from_odom(folder.path(), "/tf"), []);
    assert_eq!(map_from_odom(folder.path(), "/tf_static"), [(100, 0.0)]);
}

#[test]
fn pictures_before_the_first_scan_come_back() {
    let folder = tempfile::tempdir().unwrap();
    let left_out = exported(folder.path(), false, |recording| {
        let layout = FrameLayout::packed(80, 60, PixelFormat::Grey);
        for seq in 1..=3 {
            recording.picture::<CameraFrame>(seq, seq * 100 * MS, &layout, &vec![7; layout.bytes()]).unwrap();
        }
        recording.scan(1, 350 * MS, &scan(0.0, Pose::default())).unwrap();
    });
    assert_eq!(left_out, [""; 0]);
    let bag = Bag::open(&folder.path().join("bag")).unwrap();
    let imported = import(&bag, survey(&bag, &[]).unwrap(), &preamble(), &folder.path().join("again.mcap")).unwrap();
    assert_eq!((imported.pictures, imported.scans, imported.left_out), (3, 1, Vec::new()));
}

#[test]
fn what_a_bag_does_not_carry_is_counted() {
    let folder = tempfile::tempdir().unwrap();
    let left_out = exported(folder.path(), false, |recording| {
        let after_loss = SonarScan { after_gap: AFTER_LOSS, ..scan(0.0, Pose::default()) };
        let scans = [
            (100, scan(0.0, Pose::default())),
            (110, scan(0.0, Pose::default())),
            (130, after_loss),
            // An import finds a loss where the odometry is silent for more than a second.
            (1131, after_loss),
            (1200, scan(0.0, Pose::new(0.1, 0.0, 0.0))),
        ];
        for (seq, (stamp_ms, scan)) in (1..).zip(&scans) {
            recording.scan(seq, stamp_ms * MS, scan).unwrap();
        }
    });
    assert_eq!(
        left_out,
        [
            "topic robot/scan: readings at another mount than that of their sonar are in the bag at that of their sonar (1 message)",
            "topic robot/scan: scans less than 20 ms after the one before: an import joins them (1 message)",
            "topic robot/scan: that packets were lost before a scan is not in the bag (1 message)",
        ]
    );
}
