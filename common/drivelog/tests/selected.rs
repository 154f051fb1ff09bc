//! Spans and topics of a log, pieces that are put together again, and tables.
#![allow(clippy::unwrap_used, clippy::panic, reason = "tests fail by panicking")]

mod payloads;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use mcap::records::MessageHeader;
use messages::{Pose, Progress, SonarReading, SonarScan};
use stillmap_drivelog::{Log, Recording, Selection, Span, export_csv, info, merge, select};

const SCANS: u64 = 50;
const MS: u64 = 1_000_000;

fn scan(seq: u64) -> SonarScan {
    let reading = SonarReading::new(seq as u32 % 7, Pose::new(0.1, 0.0, 0.5), 1.25, true);
    SonarScan::new(Pose::new(seq as f64, 0.0, 0.0), &[reading; 2][..seq as usize % 3], false)
}

/// A log with a scan and a report every 100 ms.
fn record(path: &Path, run: u64) {
    let mut recording = Recording::new(&payloads::preamble(run)).unwrap();
    for seq in 1..=SCANS {
        recording.scan(seq, seq * 100 * MS, &scan(seq)).unwrap();
        recording.report(seq, 0, &Progress::default()).unwrap();
    }
    std::fs::write(path, recording.finish().unwrap()).unwrap();
}

/// Topic, number, time and bytes of every message.
fn messages(path: &Path) -> Vec<(String, u32, u64, Vec<u8>)> {
    let mut log = Log::open(path).unwrap();
    let mut messages = Vec::new();
    while log.advance().unwrap() {
        let message = log.message().unwrap();
        messages.push((message.channel.topic.clone(), message.sequence, message.log_ns, message.data.to_vec()));
    }
    messages
}

fn cut(log: &Path, from_ms: u64, to_ms: Option<u64>, to: &Path) {
    select(log, &Selection { span: Span { from_ns: from_ms * MS, to_ns: to_ms.map(|ms| ms * MS) }, topics: Vec::new() }, to).unwrap();
}

#[test]
fn pieces_that_overlap_are_the_log_again() {
    let folder = tempfile::tempdir().unwrap();
    let [log, early, late, again] = ["drive.mcap", "early.mcap", "late.mcap", "again.mcap"].map(|name| folder.path().join(name));
    record(&log, 7);
    cut(&log, 0, Some(3_000), &early);
    cut(&log, 2_000, None, &late);
    let late_scans: Vec<u32> =
        messages(&late).iter().filter(|(topic, ..)| topic == "robot/scan").map(|(_, sequence, ..)| *sequence).collect();
    assert_eq!(late_scans, (21..=50).collect::<Vec<_>>());
    assert!(info(&late).unwrap().is_complete(), "a log may begin with any scan");
    merge(&[late, early], &again).unwrap();
    // Reports have no numbers of their own: those of the overlap are there twice.
    let numbered = |path: &Path| messages(path).into_iter().filter(|(topic, ..)| topic.starts_with("robot/")).collect::<Vec<_>>();
    assert_eq!(numbered(&again), numbered(&log));
    assert!(messages(&again).is_sorted_by_key(|(_, _, log_ns, _)| *log_ns));
}

#[test]
fn chosen_topics_are_copied_and_a_missing_one_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let [log, scans] = ["drive.mcap", "scans.mcap"].map(|name| folder.path().join(name));
    record(&log, 7);
    let choose = |topics: &[&str]| Selection { topics: topics.iter().map(|topic| (*topic).to_owned()).collect(), ..Selection::default() };
    select(&log, &choose(&["robot/scan"]), &scans).unwrap();
    assert!(messages(&scans).iter().all(|(topic, ..)| topic == "robot/scan"));
    assert_eq!(messages(&scans).len() as u64, SCANS);
    let other = folder.path().join("other.mcap");
    let refused = select(&log, &choose(&["robot/scan", "robot/scam"]), &other).unwrap_err().to_string();
    assert_eq!(refused, format!("{}: has no topic \"robot/scam\", its topics are health/progress, robot/pose, robot/scan", log.display()));
    assert!(!other.exists());
}

#[test]
fn pieces_of_two_runs_are_not_put_together() {
    let folder = tempfile::tempdir().unwrap();
    let [one, other, to] = ["one.mcap", "other.mcap", "to.mcap"].map(|name| folder.path().join(name));
    record(&one, 7);
    record(&other, 8);
    let refused = merge(&[one, other.clone()], &to).unwrap_err().to_string();
    assert_eq!(refused, format!("{}: is of run 0000000000000008, expected 0000000000000007 as the first", other.display()));
    assert!(!to.exists());
}

#[test]
fn tables_have_a_line_for_each_message_and_each_entry() {
    let folder = tempfile::tempdir().unwrap();
    let [log, to] = ["drive.mcap", "tables"].map(|name| folder.path().join(name));
    record(&log, 7);
    let tables = export_csv(&log, &to).unwrap();
    let readings: u64 = (1..=SCANS).map(|seq| scan(seq).readings().len() as u64).sum();
    let rows: Vec<(PathBuf, u64)> = tables.tables.into_iter().map(|table| (table.path, table.rows)).collect();
    let expected = [("health_progress.csv", SCANS), ("robot_scan.csv", SCANS), ("robot_scan.readings.csv", readings)];
    assert_eq!(rows, expected.map(|(name, rows)| (to.join(name), rows)));
    let lines = |name: &str| std::fs::read_to_string(to.join(name)).unwrap().lines().take(2).collect::<Vec<_>>().join("\n");
    assert_eq!(lines("robot_scan.csv"), "stamp_ns,seq,pose.x_m,pose.y_m,pose.yaw_rad,after_gap\n100000000,1,1.0,0.0,0.0,0");
    assert_eq!(
        lines("robot_scan.readings.csv"),
        "stamp_ns,seq,index,mount.x_m,mount.y_m,mount.yaw_rad,range_m,sonar,echo\n100000000,1,0,0.1,0.0,0.5,1.25,1,1"
    );
    assert!(export_csv(&log, &to).unwrap_err().to_string().contains("exists"));
}

#[test]
fn what_pieces_lack_together_is_listed() {
    let folder = tempfile::tempdir().unwrap();
    let [log, early, late, again] = ["drive.mcap", "early.mcap", "late.mcap", "again.mcap"].map(|name| folder.path().join(name));
    record(&log, 7);
    cut(&log, 500, Some(1_900), &early);
    cut(&log, 3_000, None, &late);
    let merged = merge(&[early, late], &again).unwrap();
    assert_eq!(merged.gaps.lines(), ["robot/scan: 10 messages: 21 to 30"]);
}

/// A log with topics of another program, each with its messages in JSON.
fn foreign(path: &Path, messages: &[(&str, &str)]) {
    record(path, 7);
    let bytes = std::fs::read(path).unwrap();
    let summary = mcap::Summary::read(&bytes).unwrap().unwrap();
    let mut writer = mcap::WriteOptions::new().create(std::fs::File::create(path).unwrap()).unwrap();
    writer.attach(&mcap::read::attachment(&bytes, &summary.attachment_indexes[0]).unwrap()).unwrap();
    writer.write_metadata(&mcap::read::metadata(&bytes, &summary.metadata_indexes[0]).unwrap()).unwrap();
    for (topic, text) in messages {
        let channel_id = writer.add_channel(0, topic, "json", &BTreeMap::new()).unwrap();
        let header = MessageHeader { channel_id, sequence: 1, log_time: 5, publish_time: 5 };
        writer.write_to_known_channel(&header, text.as_bytes()).unwrap();
    }
    writer.finish().unwrap();
}

#[test]
fn tables_of_a_foreign_log_are_complete_and_in_their_folder() {
    let folder = tempfile::tempdir().unwrap();
    let [log, to] = ["foreign.mcap", "tables"].map(|name| folder.path().join(name));
    let list = r#"{"seq":1,"../l":[{"a":1},{"b, \"c\"":"x\ny"}]}"#;
    foreign(&log, &[("../escaped", r#"{"a":1}"#), ("/escaped", r#"{"a":1}"#), ("a/b", r#"{"a":1}"#), ("a/b", r#"{"b":2}"#), ("a_b", list)]);
    let tables = export_csv(&log, &to).unwrap();
    let found: Vec<_> =
        tables.tables.iter().map(|table| (table.path.file_name().unwrap().to_str().unwrap(), table.topic.as_str(), table.rows)).collect();
    assert_eq!(
        found,
        [
            ("_.._escaped.csv", "../escaped", 1),
            ("_escaped.csv", "/escaped", 1),
            ("a_b.csv", "a/b", 2),
            ("a_b-2.csv", "a_b", 1),
            ("a_b..._l.csv", "a_b", 2)
        ]
    );
    assert_eq!(std::fs::read_dir(&to).unwrap().count(), 5);
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 2, "nothing stands beside the folder");
    let text = |name: &str| std::fs::read_to_string(to.join(name)).unwrap();
    assert_eq!(text("a_b.csv"), "stamp_ns,a,b\n5,1,\n5,,2\n");
    assert_eq!(text("a_b..._l.csv"), "stamp_ns,seq,index,a,\"b, \"\"c\"\"\"\n5,1,0,1,\n5,1,1,,\"x\ny\"\n");
}
