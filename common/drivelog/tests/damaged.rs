//! Files that are cut, damaged, or no log: the rest is read, and the losses are reported.
#![allow(clippy::unwrap_used, clippy::panic, reason = "tests fail by panicking")]

mod payloads;

use std::path::Path;

use messages::{MapTile, Payload, SonarScan};
use proptest::prelude::*;
use proptest::strategy::ValueTree;
use proptest::test_runner::TestRunner;
use stillmap_drivelog::{Ending, Entry, Fault, Log, LogError, Outcome, Part, Recording, info, recover};

const SCANS: u64 = 6;
/// Scans between two flushes.
const HELD: u64 = 2;

/// A log, and how many of its scans a file cut at each flush holds.
struct Example {
    bytes: Vec<u8>,
    scans: Vec<SonarScan>,
    /// Size of the file after each flush, and the scans written by then.
    flushed: Vec<(usize, u64)>,
}

fn example() -> Example {
    let mut runner = TestRunner::deterministic();
    let any = payloads::scan().prop_map(|scan| SonarScan::new(scan.pose, &scan.readings()[..scan.readings().len().min(2)], false));
    let scans: Vec<SonarScan> = (0..SCANS).map(|_| any.new_tree(&mut runner).unwrap().current()).collect();
    let tile = MapTile { cell_m: 0.05, ..MapTile::default() };
    let mut recording = Recording::new(&payloads::preamble(7)).unwrap();
    let mut bytes = recording.take();
    let mut flushed = vec![(bytes.len(), 0)];
    for (seq, scan) in (1..).zip(&scans) {
        recording.scan(seq, seq * 1_000, scan).unwrap();
        if seq % HELD == 0 {
            recording.tile(seq, seq * 1_000, &tile).unwrap();
            recording.flush().unwrap();
            bytes.extend(recording.take());
            flushed.push((bytes.len(), seq));
        }
    }
    recording.end::<SonarScan>(SCANS, SCANS * 1_000).unwrap();
    bytes.extend(recording.finish().unwrap());
    Example { bytes, scans, flushed }
}

type Scans = Vec<(u64, SonarScan)>;

/// The scans of a log, and what was said while reading it.
fn read(path: &Path) -> Result<(Scans, Vec<LogError>), LogError> {
    let mut log = Log::open(path)?;
    let (mut scans, mut errors) = (Vec::new(), Vec::new());
    loop {
        match log.next_of::<SonarScan>() {
            Ok(Some(Entry::Message { seq, payload, .. })) => scans.push((seq, payload)),
            Ok(Some(Entry::End { .. })) => {}
            Ok(None) => return Ok((scans, errors)),
            Err(error) => errors.push(error),
        }
    }
}

fn is_one_line(error: &LogError) -> bool {
    let text = error.to_string();
    !text.contains('\n') && text.contains("drive.mcap")
}

#[test]
fn the_summary_of_a_cut_log_has_the_place_of_the_cut() {
    let Example { bytes, flushed, .. } = example();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("drive.mcap");
    let (size, scans) = flushed[2];
    std::fs::write(&path, &bytes[..size + 10]).unwrap();
    let summary = info(&path).unwrap();
    assert_eq!(summary.channels[SonarScan::SERVICE.name].messages, scans);
    let part = Part { path, bytes: size as u64 + 10, outcome: Outcome::Read(Ending::Cut { offset: size as u64 }) };
    assert_eq!(summary.parts, [part]);
    assert!(!summary.is_complete());
    assert!(summary.to_string().contains(&format!("cut, complete up to byte {size}")), "{summary}");
}

proptest! {
    #[test]
    fn any_bytes_are_a_log_or_a_one_line_error(noise in prop::collection::vec(any::<u8>(), 0..400), keep in 0usize..2_000, at_start: bool) {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("drive.mcap");
        let log = example().bytes;
        let mut bytes = if at_start { Vec::new() } else { log[..keep.min(log.len())].to_vec() };
        bytes.extend(noise);
        std::fs::write(&path, bytes).unwrap();
        match read(&path) {
            Ok((_, errors)) => prop_assert!(errors.iter().all(is_one_line)),
            Err(error) => prop_assert!(is_one_line(&error)),
        }
    }
}

#[test]
fn a_file_that_is_no_log_is_refused_with_its_reason() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("drive.mcap");
    let refused = |bytes: &[u8]| {
        std::fs::write(&path, bytes).unwrap();
        Log::open(&path).err().unwrap().to_string()
    };
    assert!(refused(b"").ends_with("cut at byte 0, expected the settings and the description of the run that a log starts with"));
    assert!(
        refused(b"#!/bin/sh\n")
            .contains("damaged at byte 0: found [23, 21, 2f, 62, 69, 6e, 2f, 73], expected the magic bytes of an MCAP file")
    );

    let mut other = mcap::Writer::new(std::io::Cursor::new(Vec::new())).unwrap();
    other.add_channel(0, "chatter", "json", &Default::default()).unwrap();
    other.finish().unwrap();
    let library = "recorded by mcap-rust/0.26.0: not a stillmap log";
    let said = refused(&other.into_inner().into_inner());
    assert!(said.ends_with(library), "{said}");

    std::fs::remove_file(&path).unwrap();
    assert!(Log::open(&path).err().unwrap().to_string().contains("No such file"));
}

/// `mcap` 0.26 panics when it parses an attachment that is shorter than its own fields; this reader does not use its parser.
#[test]
fn an_attachment_shorter_than_its_fields_is_damage() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("drive.mcap");
    let mut bytes = mcap::MAGIC.to_vec();
    bytes.push(mcap::records::op::ATTACHMENT);
    bytes.extend(32u64.to_le_bytes());
    bytes.extend([0; 32]);
    std::fs::write(&path, bytes).unwrap();
    assert!(Log::open(&path).err().unwrap().to_string().contains("damaged at byte 8"));
}

#[test]
fn a_cut_log_is_recovered_into_a_complete_one() {
    let Example { bytes, scans, flushed } = example();
    let folder = tempfile::tempdir().unwrap();
    let (from, to) = (folder.path().join("drive.mcap"), folder.path().join("recovered.mcap"));
    let (size, count) = flushed[2];
    std::fs::write(&from, &bytes[..size + 100]).unwrap();
    let recovered = recover(&from, &to).unwrap();
    assert!(recovered.damages.is_empty());
    assert_eq!(recovered.bytes, std::fs::metadata(&to).unwrap().len());

    let summary = info(&to).unwrap();
    assert!(summary.is_complete(), "{summary}");
    assert_eq!(summary.preamble, payloads::preamble(7));
    assert_eq!(summary.channels, info(&from).unwrap().channels);
    assert_eq!(summary.channels.values().map(|channel| channel.messages).sum::<u64>(), recovered.messages);
    let (found, _) = read(&to).unwrap();
    assert_eq!(found, (1..).zip(scans).take(usize::try_from(count).unwrap()).collect::<Vec<_>>());

    // A file that is there already is not overwritten.
    assert!(matches!(*recover(&from, &to).unwrap_err().fault, Fault::Io(_)));
}

#[test]
fn recovery_leaves_a_damaged_chunk_out() {
    let Example { mut bytes, flushed, .. } = example();
    let folder = tempfile::tempdir().unwrap();
    let (from, to) = (folder.path().join("drive.mcap"), folder.path().join("recovered.mcap"));
    let (second_chunk, before) = flushed[1];
    bytes[second_chunk + 200] ^= 1;
    std::fs::write(&from, &bytes).unwrap();
    let recovered = recover(&from, &to).unwrap();
    assert!(
        recovered.damages[0].to_string().contains(&format!("damaged at byte {second_chunk}: found a chunk")),
        "{:?}",
        recovered.damages
    );
    assert_eq!(recovered.gaps.lines(), [format!("robot/scan: {HELD} messages: {} to {}", before + 1, before + HELD)]);
    let (found, errors) = read(&to).unwrap();
    assert!(errors.is_empty());
    let expected: Vec<u64> = (1..=before).chain(before + HELD + 1..=SCANS).collect();
    assert_eq!(found.iter().map(|(seq, _)| *seq).collect::<Vec<_>>(), expected);
}

#[test]
fn recovery_continues_behind_a_hole() {
    let Example { mut bytes, flushed, .. } = example();
    let folder = tempfile::tempdir().unwrap();
    let (from, to) = (folder.path().join("drive.mcap"), folder.path().join("recovered.mcap"));
    // From the first chunk's index into the second chunk, and over the footer.
    let (second_chunk, before) = flushed[1];
    bytes[second_chunk - 40..second_chunk + 100].fill(0);
    let footer = bytes.len() - 40;
    bytes[footer..].fill(0xee);
    std::fs::write(&from, &bytes).unwrap();
    let recovered = recover(&from, &to).unwrap();
    assert!(recovered.damages.iter().all(|damage| damage.to_string().ends_with(" bytes are passed over")), "{:?}", recovered.damages);
    assert_eq!(recovered.damages.len(), 2);
    let summary = info(&to).unwrap();
    assert!(!summary.is_complete() && summary.damage_count == 0 && summary.gaps == recovered.gaps, "{summary}");
    let (found, errors) = read(&to).unwrap();
    assert!(errors.is_empty());
    let expected: Vec<u64> = (1..=before).chain(before + HELD + 1..=SCANS).collect();
    assert_eq!(found.iter().map(|(seq, _)| *seq).collect::<Vec<_>>(), expected);
}

#[test]
fn a_message_with_invalid_numbers_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("drive.mcap");
    let mut recording = Recording::new(&payloads::preamble(7)).unwrap();
    let mut scan = SonarScan::default();
    scan.pose.x_m = 1e9;
    recording.message(5, 50, &scan).unwrap();
    std::fs::write(&path, recording.finish().unwrap()).unwrap();
    let error = Log::open(&path).unwrap().next_of::<SonarScan>().unwrap_err().to_string();
    assert!(error.contains(&format!("message 5 of {}", SonarScan::SERVICE.name)), "{error}");
    assert!(error.ends_with("pose.x_m is 1000000000, expected at most 1000 km from the origin"), "{error}");
}
