//! A file that the usual MCAP tool compressed, and one of another program that was cut.
#![allow(clippy::unwrap_used, clippy::panic, reason = "tests fail by panicking")]

use std::collections::BTreeMap;
use std::io::Cursor;
use std::path::Path;

use messages::SonarScan;
use stillmap_drivelog::{Entry, Log};

#[test]
fn a_cut_file_of_another_program_is_refused() {
    let mut writer = mcap::Writer::new(Cursor::new(Vec::new())).unwrap();
    writer.add_channel(0, "chatter", "json", &BTreeMap::new()).unwrap();
    writer.finish().unwrap();
    let bytes = writer.into_inner().into_inner();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("log.mcap");
    for length in 0..bytes.len() {
        std::fs::write(&path, &bytes[..length]).unwrap();
        assert!(Log::open(&path).is_err(), "cut at {length}");
    }
}

/// Zstandard, the metadata first and the attachment last.
#[test]
fn a_log_compressed_by_the_usual_tool_is_read() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/compressed.mcap");
    let mut log = Log::open(&path).unwrap();
    let mut count = 0;
    while let Some(entry) = log.next_of::<SonarScan>().unwrap() {
        count += u64::from(matches!(entry, Entry::Message { .. }));
    }
    assert_eq!((count, log.preamble().robot.as_str()), (20, "pioneer-1"));
}
