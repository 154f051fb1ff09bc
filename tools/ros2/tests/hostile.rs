//! Bags whose messages are any bytes.
#![allow(clippy::unwrap_used, clippy::panic, reason = "tests fail by panicking")]

use std::collections::BTreeMap;
use std::path::Path;

use drivelog::{Log, Preamble, Recording};
use mcap::records::MessageHeader;
use mcap::{MessageStream, WriteOptions};
use messages::{CameraFrame, FrameLayout, PixelFormat, Pose, SonarReading, SonarScan};
use proptest::prelude::*;
use proptest::sample::Index;
use stillmap_ros2::{Bag, Sensors, export, import, survey};

const TYPES: [(&str, &str); 8] = [
    ("/range", "sensor_msgs/msg/Range"),
    ("/odom", "nav_msgs/msg/Odometry"),
    ("/tf", "tf2_msgs/msg/TFMessage"),
    ("/tf_static", "tf2_msgs/msg/TFMessage"),
    ("/camera/image_raw", "sensor_msgs/msg/Image"),
    ("/camera/image_raw/compressed", "sensor_msgs/msg/CompressedImage"),
    ("/camera/camera_info", "sensor_msgs/msg/CameraInfo"),
    ("/stillmap/settings", "std_msgs/msg/String"),
];

fn preamble(sonars: usize) -> Preamble {
    Preamble { run: 1, robot: "x".to_owned(), sonars: vec![Pose::default(); sonars], origin: "a test".to_owned(), settings: String::new() }
}

/// Messages of a bag, by topic and type.
type Messages = Vec<(String, String, Vec<u8>)>;

/// The messages of a bag that is intact.
fn intact(folder: &Path) -> Messages {
    let mut recording = Recording::new(&preamble(1)).unwrap();
    for seq in 1..=10 {
        let reading = SonarReading::new(0, Pose::default(), 1.25, true);
        let layout = FrameLayout::packed(80, 60, PixelFormat::Grey);
        recording.scan(seq, seq * 100_000_000, &SonarScan::new(Pose::new(0.1, 0.0, 0.0), &[reading], false)).unwrap();
        recording.picture::<CameraFrame>(seq, seq * 100_000_000, &layout, &vec![7; layout.bytes()]).unwrap();
    }
    let [log, bag] = ["log.mcap", "bag"].map(|name| folder.join(name));
    std::fs::write(&log, recording.finish().unwrap()).unwrap();
    let sensors = Sensors {
        sonars: vec![Pose::default()],
        max_range_m: 3.0,
        field_of_view_rad: 0.4,
        camera: Pose::default(),
        camera_height_m: 0.3,
        camera_field_of_view_rad: 1.0,
        horizon_share: 0.5,
    };
    export(&mut Log::open(&log).unwrap(), &sensors, &bag).unwrap();
    let bytes = std::fs::read(bag.join("bag_0.mcap")).unwrap();
    let message = |message: mcap::Message<'_>| {
        let type_name = message.channel.schema.as_ref().unwrap().name.clone();
        (message.channel.topic.clone(), type_name, message.data.to_vec())
    };
    MessageStream::new(&bytes).unwrap().map(|next| message(next.unwrap())).collect()
}

fn write(path: &Path, messages: &Messages) {
    let file = std::fs::File::create(path).unwrap();
    let mut writer = WriteOptions::new().profile("ros2").compression(None).create(file).unwrap();
    for (time, (topic, type_name, data)) in (1..).zip(messages) {
        let schema = writer.add_schema(type_name, "ros2msg", b"").unwrap();
        let channel_id = writer.add_channel(schema, topic, "cdr", &BTreeMap::new()).unwrap();
        let header = MessageHeader { channel_id, sequence: 0, log_time: time, publish_time: time };
        writer.write_to_known_channel(&header, data).unwrap();
    }
    writer.finish().unwrap();
}

/// Imports the messages. What cannot be imported is an error in one line.
fn check(folder: &Path, messages: &Messages) {
    let [bag, log] = ["hostile.mcap", "imported.mcap"].map(|name| folder.join(name));
    write(&bag, messages);
    let bag = Bag::open(&bag).unwrap();
    let imported = survey(&bag, &[]).and_then(|found| {
        let sonars = found.sonars.len();
        import(&bag, found, &preamble(sonars), &log)
    });
    match imported {
        Ok(imported) => {
            assert!(drivelog::info(&log).unwrap().is_complete());
            assert!(imported.left_out.iter().all(|line| !line.contains('\n')), "{imported:?}");
            std::fs::remove_file(&log).unwrap();
        }
        Err(error) => assert!(!error.to_string().contains('\n') && !log.exists(), "{error}"),
    }
}

proptest! {
    #[test]
    fn a_bag_of_any_bytes_is_imported_or_refused(
        messages in prop::collection::vec((prop::sample::select(&TYPES[..]), prop::collection::vec(any::<u8>(), 0..400), any::<bool>()), 0..30),
    ) {
        let folder = tempfile::tempdir().unwrap();
        let message = |((topic, type_name), mut data, is_cdr): ((&str, &str), Vec<u8>, bool)| {
            if is_cdr {
                data.splice(0..data.len().min(4), [0, 1, 0, 0]);
            }
            (topic.to_owned(), type_name.to_owned(), data)
        };
        check(folder.path(), &messages.into_iter().map(message).collect());
    }

    #[test]
    fn a_bag_with_changed_bytes_is_imported_or_refused(changes in prop::collection::vec((any::<Index>(), any::<Index>(), any::<u8>()), 1..40)) {
        let folder = tempfile::tempdir().unwrap();
        let mut messages = intact(folder.path());
        for (message, place, byte) in changes {
            let message = message.index(messages.len());
            let data = &mut messages[message].2;
            // Fields are at the start, pixels behind them.
            let place = place.index(data.len().min(250));
            data[place] = byte;
        }
        check(folder.path(), &messages);
    }
}

#[test]
fn an_intact_bag_is_imported() {
    let folder = tempfile::tempdir().unwrap();
    let messages = intact(folder.path());
    check(folder.path(), &messages);
    assert!(messages.len() > 50, "{} messages", messages.len());
}
