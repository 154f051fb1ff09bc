//! Bags whose messages are any bytes.
#![allow(clippy::unwrap_used, clippy::panic, reason = "tests fail by panicking")]

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use drivelog::{Log, Preamble, Recording};
use mcap::records::MessageHeader;
use mcap::{MessageStream, WriteOptions};
use messages::{CameraFrame, FrameLayout, PixelFormat, Pose, SonarReading, SonarScan};
use proptest::prelude::*;
use proptest::sample::Index;
use rusqlite::Connection;
use ruzstd::encoding::{CompressionLevel, compress_to_vec};
use stillmap_ros2::{Bag, Imported, Sensors, export, import, survey};

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

/// Messages of a bag: topic, type, bytes, and the time when they were received.
type Messages = Vec<(String, String, Vec<u8>, u64)>;

/// How a bag is stored.
const FORMS: [&str; 4] = ["mcap", "db3", "mcap.zstd", "db3.zstd"];

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
        is_localised: false,
    };
    export(&mut Log::open(&log).unwrap(), &sensors, &bag).unwrap();
    let bytes = std::fs::read(bag.join("bag_0.mcap")).unwrap();
    let message = |message: mcap::Message<'_>| {
        let type_name = message.channel.schema.as_ref().unwrap().name.clone();
        (message.channel.topic.clone(), type_name, message.data.to_vec(), message.log_time)
    };
    MessageStream::new(&bytes).unwrap().map(|next| message(next.unwrap())).collect()
}

fn write_mcap(path: &Path, messages: &Messages) {
    let file = std::fs::File::create(path).unwrap();
    let mut writer = WriteOptions::new().profile("ros2").compression(None).chunk_size(Some(4096)).create(file).unwrap();
    for (topic, type_name, data, time_ns) in messages {
        let schema = writer.add_schema(type_name, "ros2msg", b"").unwrap();
        let channel_id = writer.add_channel(schema, topic, "cdr", &BTreeMap::new()).unwrap();
        let header = MessageHeader { channel_id, sequence: 0, log_time: *time_ns, publish_time: *time_ns };
        writer.write_to_known_channel(&header, data).unwrap();
    }
    writer.finish().unwrap();
}

/// The tables of a bag, empty.
const TABLES: &str =
    "CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT, type TEXT, serialization_format TEXT, offered_qos_profiles TEXT);
    CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER, timestamp INTEGER, data BLOB);";

fn write_sqlite(path: &Path, messages: &Messages) {
    let mut bag = Connection::open(path).unwrap();
    let bag = bag.transaction().unwrap();
    bag.execute_batch(TABLES).unwrap();
    let mut topics = Vec::new();
    for (topic, type_name, data, time_ns) in messages {
        let id = topics.iter().position(|known| *known == (topic, type_name)).unwrap_or_else(|| {
            topics.push((topic, type_name));
            bag.execute("INSERT INTO topics VALUES (?1, ?2, ?3, 'cdr', '')", (topics.len() as i64 - 1, topic, type_name)).unwrap();
            topics.len() - 1
        });
        let message = (id as i64, time_ns.cast_signed(), data);
        bag.execute("INSERT INTO messages(topic_id, timestamp, data) VALUES (?1, ?2, ?3)", message).unwrap();
    }
    bag.commit().unwrap();
}

/// A bag of these messages in one of the forms.
fn write(folder: &Path, form: &str, messages: &Messages) -> PathBuf {
    let path = folder.join(format!("hostile.{form}"));
    let plain = folder.join("plain");
    if form.starts_with("mcap") {
        write_mcap(&plain, messages)
    } else {
        write_sqlite(&plain, messages)
    }
    if form.ends_with("zstd") {
        let packed = compress_to_vec(std::fs::File::open(&plain).unwrap(), CompressionLevel::Fastest);
        std::fs::write(&path, packed).unwrap();
        std::fs::remove_file(&plain).unwrap();
    } else {
        std::fs::rename(&plain, &path).unwrap();
    }
    path
}

/// Imports a bag. What cannot be imported is an error in one line.
fn check(folder: &Path, bag: &Path) -> Result<Imported, String> {
    let log = folder.join("imported.mcap");
    let bag = Bag::open(bag).unwrap();
    let imported = survey(&bag, &[]).and_then(|found| {
        let sonars = found.sonars.len();
        import(&bag, found, &preamble(sonars), &log)
    });
    match imported {
        Ok(imported) => {
            assert!(drivelog::info(&log).unwrap().is_complete());
            assert!(imported.left_out.iter().all(|line| !line.contains('\n')), "{imported:?}");
            Ok(imported)
        }
        Err(error) => {
            assert!(!error.to_string().contains('\n') && !log.exists(), "{error}");
            Err(error.to_string())
        }
    }
}

/// Removes the stamp of a message that starts with its header: its stamp is the time when it was received.
fn unstamp((topic, _, data, _): &mut (String, String, Vec<u8>, u64)) {
    if topic.starts_with("/sonar") || topic.starts_with("/camera") || topic == "/odom" {
        data[4..12].fill(0);
    }
}

/// Times as they are in bags, and any.
fn time_ns() -> impl Strategy<Value = u64> {
    prop_oneof![4 => 1_u64..5_000_000_000, 1 => any::<u64>(), 1 => Just(i64::MAX as u64), 1 => Just(i64::MAX as u64 + 1), 1 => Just(u64::MAX)]
}

fn form() -> impl Strategy<Value = &'static str> {
    prop::sample::select(&FORMS[..])
}

proptest! {
    #[test]
    fn a_bag_of_any_bytes_is_imported_or_refused(
        messages in prop::collection::vec(
            (prop::sample::select(&TYPES[..]), prop::collection::vec(any::<u8>(), 0..400), any::<bool>(), time_ns()), 0..30),
        form in form(),
    ) {
        let folder = tempfile::tempdir().unwrap();
        let message = |((topic, type_name), mut data, is_cdr, time_ns): ((&str, &str), Vec<u8>, bool, u64)| {
            if is_cdr {
                data.splice(0..data.len().min(4), [0, 1, 0, 0]);
            }
            (topic.to_owned(), type_name.to_owned(), data, time_ns)
        };
        let _ = check(folder.path(), &write(folder.path(), form, &messages.into_iter().map(message).collect()));
    }

    #[test]
    fn a_bag_with_changed_bytes_is_imported_or_refused(
        changes in prop::collection::vec((any::<Index>(), any::<Index>(), any::<u8>(), time_ns()), 1..40),
        form in form(),
    ) {
        let folder = tempfile::tempdir().unwrap();
        let mut messages = intact(folder.path());
        for (message, place, byte, time_ns) in changes {
            let message = message.index(messages.len());
            let (_, _, data, received_ns) = &mut messages[message];
            // Fields are at the start, pixels behind them.
            let place = place.index(data.len().min(250));
            data[place] = byte;
            *received_ns = time_ns;
            unstamp(&mut messages[message]);
        }
        let _ = check(folder.path(), &write(folder.path(), form, &messages));
    }

    #[test]
    fn a_file_with_changed_bytes_is_imported_or_refused(
        changes in prop::collection::vec((any::<Index>(), any::<u8>()), 1..10),
        cut in prop::option::of(any::<Index>()),
        form in form(),
    ) {
        let folder = tempfile::tempdir().unwrap();
        let path = write(folder.path(), form, &intact(folder.path()));
        let mut bytes = std::fs::read(&path).unwrap();
        for (place, byte) in changes {
            let place = place.index(bytes.len());
            bytes[place] = byte;
        }
        bytes.truncate(cut.map_or(bytes.len(), |cut| cut.index(bytes.len())));
        std::fs::write(&path, bytes).unwrap();
        let _ = check(folder.path(), &path);
    }
}

#[test]
fn an_intact_bag_is_imported_in_every_form() {
    for form in FORMS {
        let folder = tempfile::tempdir().unwrap();
        let messages = intact(folder.path());
        assert!(messages.len() > 50, "{} messages", messages.len());
        let imported = check(folder.path(), &write(folder.path(), form, &messages)).unwrap();
        assert_eq!(imported, Imported { scans: 10, readings: 10, pictures: 10, left_out: Vec::new() }, "{form}");
    }
}

#[test]
fn a_time_that_ros_cannot_have_is_named() {
    for form in ["mcap", "db3"] {
        let folder = tempfile::tempdir().unwrap();
        let mut messages = intact(folder.path());
        let odometry = messages.iter().position(|(topic, ..)| topic == "/odom").unwrap();
        messages[odometry].3 = u64::MAX;
        let imported = check(folder.path(), &write(folder.path(), form, &messages)).unwrap();
        let (number, time_ns) = if form == "mcap" { (1, "18446744073709551615".to_owned()) } else { (odometry + 1, "-1".to_owned()) };
        let expected = format!("topic /odom: message {number} has the time {time_ns} ns, expected 0 to 9223372036854775807");
        assert!(imported.left_out.contains(&expected), "{:?}", imported.left_out);
        assert_eq!(imported.pictures, 10);
    }
}

#[test]
fn scans_at_the_last_time_of_all_are_imported() {
    let folder = tempfile::tempdir().unwrap();
    let mut messages = intact(folder.path());
    for message in &mut messages {
        message.3 = i64::MAX as u64;
        unstamp(message);
    }
    check(folder.path(), &write(folder.path(), "mcap", &messages)).unwrap();
}

#[test]
fn a_damaged_chunk_or_message_costs_only_itself() {
    let folder = tempfile::tempdir().unwrap();
    let mut messages = intact(folder.path());
    let picture = messages.iter().rposition(|(topic, ..)| topic == "/camera/image_raw").unwrap();
    messages[picture].2 = vec![0x28, 0xb5, 0x2f, 0xfd, 0xff, 0xff];
    let path = write(folder.path(), "mcap", &messages);
    let mut bytes = std::fs::read(&path).unwrap();
    let first = mcap::Summary::read(&bytes).unwrap().unwrap().chunk_indexes[0].clone();
    bytes[first.chunk_start_offset as usize + 100] ^= 0xff;
    std::fs::write(&path, bytes).unwrap();
    let imported = check(folder.path(), &path).unwrap();
    assert!(imported.scans >= 9 && imported.pictures >= 8, "{imported:?}");
    assert!(imported.left_out.iter().any(|line| line.contains("damaged at byte")), "{imported:?}");
    assert!(
        imported.left_out.iter().any(|line| line.starts_with("topic /camera/image_raw: messages that cannot be unpacked")),
        "{imported:?}"
    );
}

#[test]
fn a_thousand_damages_are_counted() {
    let folder = tempfile::tempdir().unwrap();
    let mut messages = intact(folder.path());
    let range = messages.iter().find(|(topic, ..)| topic == "/sonar/range_0").unwrap().clone();
    messages.extend((0..1000).map(|_| (range.0.clone(), range.1.clone(), range.2.clone(), u64::MAX)));
    let imported = check(folder.path(), &write(folder.path(), "mcap", &messages)).unwrap();
    assert_eq!(imported.left_out.len(), 21);
    assert_eq!(imported.left_out[20], "980 more damages");
}

#[test]
fn a_bag_whose_tables_compute_their_rows_is_refused() {
    let check = |change: &str, table: &str| {
        let folder = tempfile::tempdir().unwrap();
        let path = write(folder.path(), "db3", &intact(folder.path()));
        Connection::open(&path).unwrap().execute_batch(change).unwrap();
        let refused = check(folder.path(), &path).unwrap_err();
        assert_eq!(refused, format!("{}: has no table {table:?} with stored columns only", path.display()));
    };
    check("ALTER TABLE messages RENAME TO m; CREATE VIEW messages AS SELECT * FROM m", "messages");
    check("ALTER TABLE messages RENAME TO m; CREATE VIRTUAL TABLE messages USING fts5(id, topic_id, timestamp, data)", "messages");
    check("ALTER TABLE topics ADD COLUMN more AS (zeroblob(1000000))", "topics");
}

#[test]
fn a_message_of_sqlite_that_is_no_message_costs_only_itself() {
    let folder = tempfile::tempdir().unwrap();
    let path = write(folder.path(), "db3", &intact(folder.path()));
    let bag = Connection::open(&path).unwrap();
    let picture = "(SELECT id FROM topics WHERE type = 'sensor_msgs/msg/Image')";
    // One byte more than is read, before all others; a text; and no time.
    let more = format!(
        "INSERT INTO messages VALUES (-3, {picture}, 1, zeroblob(67108865)), (-2, {picture}, 1, 'x'), (-1, {picture}, 'then', zeroblob(9));"
    );
    bag.execute_batch(&more).unwrap();
    drop(bag);
    let imported = check(folder.path(), &path).unwrap();
    assert_eq!((imported.scans, imported.pictures), (10, 10));
    let expected =
        ["message -3 has no data of at most 67108864 bytes", "message -2 has no data of at most 67108864 bytes", "message -1 has no time"];
    assert_eq!(imported.left_out, expected.map(|problem| format!("topic /camera/image_raw: {problem}")));
}
