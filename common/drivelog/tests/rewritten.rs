//! MCAP files that other programs wrote or rewrote.
#![allow(clippy::unwrap_used, clippy::panic, reason = "tests fail by panicking")]

mod payloads;

use std::io::Cursor;
use std::path::Path;

use mcap::{Compression, MessageStream, WriteOptions};
use messages::SonarScan;
use stillmap_drivelog::{Entry, Fault, Log, Recording};

const SCANS: u64 = 9;

fn log() -> Vec<u8> {
    let mut recording = Recording::new(&payloads::preamble(7)).unwrap();
    for seq in 1..=SCANS {
        recording.scan(seq, seq * 1_000, &SonarScan::default()).unwrap();
    }
    recording.finish().unwrap()
}

/// The messages of a file written anew, as a tool does that compresses it; with `preamble`, metadata and attachments follow them.
fn rewritten(bytes: &[u8], preamble: bool, options: WriteOptions) -> Vec<u8> {
    let mut out = Cursor::new(Vec::new());
    let mut writer = options.library("a tool 1.0").create(&mut out).unwrap();
    for message in MessageStream::new(bytes).unwrap() {
        writer.write(&message.unwrap()).unwrap();
    }
    let summary = mcap::Summary::read(bytes).unwrap().unwrap();
    for index in summary.metadata_indexes.iter().filter(|_| preamble) {
        writer.write_metadata(&mcap::read::metadata(bytes, index).unwrap()).unwrap();
    }
    for index in summary.attachment_indexes.iter().filter(|_| preamble) {
        writer.attach(&mcap::read::attachment(bytes, index).unwrap()).unwrap();
    }
    writer.finish().unwrap();
    drop(writer);
    out.into_inner()
}

fn scans(bytes: &[u8]) -> Result<Vec<u64>, Fault> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("log.mcap");
    std::fs::write(&path, bytes).unwrap();
    let mut log = Log::open(Path::new(&path)).map_err(|error| *error.fault)?;
    assert_eq!(log.preamble(), &payloads::preamble(7));
    let mut scans = Vec::new();
    while let Some(entry) = log.next_of::<SonarScan>().unwrap() {
        if let Entry::Message { seq, .. } = entry {
            scans.push(seq);
        }
    }
    Ok(scans)
}

#[test]
fn a_preamble_behind_the_messages_is_found() {
    let expected: Vec<u64> = (1..=SCANS).collect();
    for compression in [None, Some(Compression::Lz4)] {
        let bytes = rewritten(&log(), true, WriteOptions::new().compression(compression));
        assert_eq!(scans(&bytes).unwrap(), expected);
    }
}

#[test]
fn a_file_of_another_program_is_named_and_not_called_damaged() {
    let fault = scans(&rewritten(&log(), false, WriteOptions::new())).unwrap_err();
    assert!(matches!(&fault, Fault::Foreign { library, .. } if library == "a tool 1.0"), "{fault}");
    assert!(!fault.to_string().contains("damaged"), "{fault}");
}

#[test]
fn a_cut_file_of_another_program_is_refused() {
    let bytes = rewritten(&log(), false, WriteOptions::new());
    for length in (0..bytes.len()).step_by(37) {
        assert!(scans(&bytes[..length]).is_err(), "cut at {length}");
    }
}

/// A log that the mcap command compressed: Zstandard, its metadata first and its attachment last.
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
