//! Bags that are exported and imported again, and bags of another program.
#![allow(clippy::unwrap_used, clippy::panic, clippy::print_stderr, reason = "tests fail by panicking, and say what they skip")]

use std::f64::consts::PI;
use std::path::Path;
use std::process::Command;

use drivelog::{Entry, Image, Log, Preamble, Recording};
use messages::{AFTER_DOUBT, CameraFrame, FrameLayout, MapTile, PixelFormat, Pose, SonarReading, SonarScan, TrackedWalker, Walkers};
use stillmap_ros2::{Bag, Imported, Sensors, export, import, survey};

const SCANS: u64 = 40;
const LIMIT_M: f64 = 3.0;

fn ring() -> Vec<Pose> {
    [90.0_f64, 15.0, -15.0].map(|deg| Pose { x_m: 0.1, y_m: deg / 900.0, yaw_rad: deg.to_radians() }).to_vec()
}

fn preamble() -> Preamble {
    let settings = "name = \"x\"\n".to_owned();
    Preamble { run: 1, robot: "pioneer-1".to_owned(), sonars: ring(), origin: "a test".to_owned(), settings }
}

fn sensors() -> Sensors {
    Sensors {
        sonars: ring(),
        max_range_m: LIMIT_M,
        field_of_view_rad: 25.0_f64.to_radians(),
        camera: Pose { x_m: 0.2, y_m: 0.0, yaw_rad: 0.1 },
        camera_height_m: 0.3,
        camera_field_of_view_rad: 70.0_f64.to_radians(),
        horizon_share: 0.45,
        is_localised: false,
    }
}

/// A scan with readings of up to three sonars, the last sonar first.
fn scan(seq: u64) -> SonarScan {
    let reading = |sonar: u32| {
        let has_echo = !(seq + u64::from(sonar)).is_multiple_of(5);
        let range_m = if has_echo { (seq * 37 % 2900) as f64 / 1000.0 } else { LIMIT_M };
        SonarReading::new(sonar, ring()[sonar as usize], range_m, has_echo)
    };
    let readings: Vec<SonarReading> = (0..3).rev().filter(|sonar| seq % 4 > u64::from(*sonar)).map(reading).collect();
    // The odometry counts turns.
    let pose = Pose { x_m: 0.01 * seq as f64, y_m: 0.001 * seq as f64, yaw_rad: 0.2 * seq as f64 };
    let after_gap = if seq == 20 { AFTER_DOUBT } else { 0 };
    SonarScan { after_gap, ..SonarScan::new(pose, &readings, false) }
}

fn stamp_ns(seq: u64) -> u64 {
    1_700_000_000_000_000_000 + seq * 100_000_000
}

fn picture(seq: u64) -> (FrameLayout, Vec<u8>) {
    let layout = FrameLayout::packed(80, 60, PixelFormat::Grey);
    (layout, (0..layout.bytes()).map(|at| (at as u64 * seq % 251) as u8).collect())
}

/// A log of a drive at this path.
fn record(path: &Path) {
    let mut recording = Recording::new(&preamble()).unwrap();
    for seq in 1..=SCANS {
        recording.scan(seq, stamp_ns(seq), &scan(seq)).unwrap();
        let (layout, bytes) = picture(seq);
        recording.picture::<CameraFrame>(seq, stamp_ns(seq) + 5, &layout, &bytes).unwrap();
        let mut walkers = Walkers { count: 1, ..Walkers::default() };
        walkers.walkers[0] = TrackedWalker { x_m: 2.0, track: 1, ..TrackedWalker::default() };
        recording.add(seq, stamp_ns(seq), &walkers).unwrap();
    }
    let mut tile = MapTile { cell_m: 0.05, tiles_in_layer: 1, ..MapTile::default() };
    tile.log_odds[5] = 2.0;
    recording.tile(1, stamp_ns(SCANS), &tile).unwrap();
    recording.end::<SonarScan>(SCANS, stamp_ns(SCANS)).unwrap();
    std::fs::write(path, recording.finish().unwrap()).unwrap();
}

/// Imports a bag with the mounts of the ring.
fn import_into(bag: &Path, log: &Path) -> Imported {
    let bag = Bag::open(bag).unwrap();
    let found = survey(&bag, &[]).unwrap();
    assert_eq!(found.settings.as_deref(), Some(preamble().settings.as_str()));
    for (sonar, mount) in found.sonars.iter().zip(ring()) {
        let found = sonar.mount.unwrap();
        assert!((found.x_m - mount.x_m).abs() < 1e-12 && (found.yaw_rad - mount.yaw_rad).abs() < 1e-12, "{sonar:?}");
        assert!((sonar.max_range_m - LIMIT_M).abs() < 1e-12, "{sonar:?}");
    }
    let camera = found.camera.as_ref().unwrap();
    let (mount, optics) = (camera.mount.unwrap(), camera.optics.unwrap());
    assert!((mount.heading_rad - 0.1).abs() < 1e-9 && mount.tilt_rad.abs() < 1e-9 && mount.height_m > 0.29, "{mount:?}");
    assert!((optics.field_of_view_rad.to_degrees() - 70.0).abs() < 1e-9 && (optics.horizon_share(mount.tilt_rad) - 0.45).abs() < 1e-9);
    import(&bag, found, &preamble(), log).unwrap()
}

fn scans(path: &Path) -> Vec<(u64, u64, SonarScan)> {
    let mut log = Log::open(path).unwrap();
    let mut scans = Vec::new();
    while let Some(entry) = log.next_of::<SonarScan>().unwrap() {
        if let Entry::Message { seq, stamp_ns, payload } = entry {
            scans.push((seq, stamp_ns, payload));
        }
    }
    scans
}

fn pictures(path: &Path) -> Vec<(u64, u64, Image)> {
    let mut log = Log::open(path).unwrap();
    let mut pictures = Vec::new();
    while let Some(entry) = log.next_picture::<CameraFrame>().unwrap() {
        if let Entry::Message { seq, stamp_ns, payload } = entry {
            pictures.push((seq, stamp_ns, payload));
        }
    }
    pictures
}

/// The log holds the drive that was recorded, but for the last bits of headings, which quaternions round.
fn assert_is_the_drive(log: &Path) {
    let found = scans(log);
    assert_eq!(found.len() as u64, SCANS);
    for (expected_seq, (seq, stamp, found)) in (1..).zip(found) {
        let expected = scan(expected_seq);
        assert_eq!((seq, stamp), (expected_seq, stamp_ns(expected_seq)));
        assert_eq!((found.readings(), found.after_gap), (expected.readings(), expected.after_gap), "scan {seq}");
        assert_eq!((found.pose.x_m, found.pose.y_m), (expected.pose.x_m, expected.pose.y_m));
        let turn = (found.pose.yaw_rad - expected.pose.yaw_rad) / (2.0 * PI);
        assert!((turn - turn.round()).abs() < 1e-12, "scan {seq}: {} instead of {}", found.pose.yaw_rad, expected.pose.yaw_rad);
    }
    let pictures = pictures(log);
    assert_eq!(pictures.len() as u64, SCANS);
    for (seq, stamp, image) in pictures {
        assert_eq!((stamp, (image.layout, image.bytes)), (stamp_ns(seq) + 5, picture(seq)));
    }
}

#[test]
fn a_log_that_becomes_a_bag_and_a_log_again_is_the_same() {
    let folder = tempfile::tempdir().unwrap();
    let [log, bag, again] = ["drive.mcap", "bag", "again.mcap"].map(|name| folder.path().join(name));
    record(&log);
    let exported = export(&mut Log::open(&log).unwrap(), &sensors(), &bag).unwrap();
    assert_eq!(exported.left_out, [""; 0]);
    for (topic, count) in
        [("/odom", SCANS), ("/tf", SCANS), ("/tf_static", 1), ("/map", 1), ("/walkers", SCANS), ("/camera/image_raw", SCANS)]
    {
        assert_eq!(exported.messages.get(topic), Some(&count), "{topic}");
    }
    let imported = import_into(&bag, &again);
    let readings = (1..=SCANS).map(|seq| scan(seq).readings().len() as u64).sum();
    assert_eq!(imported, Imported { scans: SCANS, readings, pictures: SCANS, left_out: Vec::new() });
    assert_is_the_drive(&again);
}

/// Bags that another implementation has written. `pip install rosbags` provides it.
#[test]
fn a_bag_in_every_storage_and_compression_is_read() {
    let python = |script: &[&str]| Command::new("python3").args(script).output();
    if !python(&["-c", "import rosbags"]).is_ok_and(|output| output.status.success()) {
        eprintln!("skipped: python3 has no package rosbags");
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let [log, bag, forms] = ["drive.mcap", "bag", "forms"].map(|name| folder.path().join(name));
    record(&log);
    export(&mut Log::open(&log).unwrap(), &sensors(), &bag).unwrap();
    std::fs::create_dir(&forms).unwrap();
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/rewrite_bag.py");
    let output = Command::new("python3").args([&script, &bag, &forms]).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let names = String::from_utf8(output.stdout).unwrap();
    assert_eq!(names.lines().count(), 7, "{names}");
    for name in names.lines() {
        let again = folder.path().join(name).with_extension("mcap");
        let imported = import_into(&forms.join(name), &again);
        assert_eq!(imported.left_out, [""; 0], "{name}");
        assert_is_the_drive(&again);
    }
}

#[test]
fn a_topic_that_cannot_be_imported_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let [log, bag] = ["drive.mcap", "bag"].map(|name| folder.path().join(name));
    record(&log);
    export(&mut Log::open(&log).unwrap(), &sensors(), &bag).unwrap();
    let bag = Bag::open(&bag).unwrap();
    let refused =
        |topics: &[&str]| survey(&bag, &topics.iter().map(|topic| (*topic).to_owned()).collect::<Vec<_>>()).err().unwrap().to_string();
    assert!(refused(&["/scan"]).starts_with("topic /scan: is not in the bag, which has /camera/camera_info, /camera/image_raw, /map"));
    assert!(refused(&["/walkers"]).starts_with("topic /walkers: visualization_msgs/msg/MarkerArray in \"cdr\" is not understood"));
    assert_eq!(refused(&["/odom"]), "the bag has no readable messages of sensor_msgs/msg/Range");
    // Without messages of odometry the transforms of /tf are the odometry.
    let topics = ["/sonar/range_2", "/sonar/range_0"].map(str::to_owned);
    let found = survey(&bag, &topics).unwrap();
    assert_eq!(found.sonars.iter().map(|sonar| sonar.topic.as_str()).collect::<Vec<_>>(), ["/sonar/range_2", "/sonar/range_0"]);
    let chosen = Preamble { sonars: ring()[..2].to_vec(), ..preamble() };
    let imported = import(&bag, found, &chosen, &folder.path().join("again.mcap")).unwrap();
    assert_eq!((imported.scans, imported.pictures), (SCANS, 0));
}

#[test]
fn a_log_or_a_broken_file_is_no_bag() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("bag.mcap");
    record(&path);
    assert_eq!(
        survey(&Bag::open(&path).unwrap(), &[]).err().unwrap().to_string(),
        "the bag has no odometry: neither nav_msgs/msg/Odometry nor a transform from \"odom\" in /tf"
    );
    for name in ["bag.mcap", "bag.db3"] {
        let path = folder.path().join(name);
        std::fs::write(&path, b"no bag, whatever its name says").unwrap();
        let refused = survey(&Bag::open(&path).unwrap(), &[]).err().unwrap().to_string();
        assert!(refused.starts_with(&path.display().to_string()) && !refused.contains('\n'), "{refused}");
    }
}
