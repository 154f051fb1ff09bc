//! A log in parts: a recorder continues in the next file.
#![allow(clippy::unwrap_used, clippy::panic, reason = "tests fail by panicking")]

mod payloads;

use std::path::Path;

use messages::{Heartbeat, MapTile, Payload, SonarScan};
use proptest::prelude::*;
use stillmap_drivelog::{Ending, Entry, Log, MapView, Outcome, Recording, Selection, Span, info, part_path, recover, select};

fn scan(seq: u64) -> SonarScan {
    SonarScan::new(messages::Pose { x_m: (seq % 100) as f64, ..Default::default() }, &[], false)
}

/// The file of a recorder that received these scans, killed after the last flush or not.
fn write(path: &Path, run: u64, scans: std::ops::RangeInclusive<u64>, killed: bool) {
    write_in_chunks(path, run, scans, killed, u64::MAX);
}

/// As [`write`], with so many scans in a chunk.
fn write_in_chunks(path: &Path, run: u64, scans: std::ops::RangeInclusive<u64>, killed: bool, chunk: u64) {
    let mut recording = Recording::new(&payloads::preamble(run)).unwrap();
    for seq in scans {
        recording.scan(seq, seq * 40_000_000, &scan(seq)).unwrap();
        recording.report(1, seq, &Heartbeat::default()).unwrap();
        if seq.is_multiple_of(chunk) {
            recording.flush().unwrap();
        }
    }
    recording.flush().unwrap();
    let mut bytes = recording.take();
    if !killed {
        bytes.extend(recording.finish().unwrap());
    }
    std::fs::write(path, bytes).unwrap();
}

fn scans(path: &Path) -> Vec<u64> {
    scans_of(&mut Log::open(path).unwrap())
}

fn scans_of(log: &mut Log) -> Vec<u64> {
    let mut scans = Vec::new();
    while let Some(entry) = log.next_of::<SonarScan>().unwrap() {
        let Entry::Message { seq, stamp_ns, payload } = entry else { continue };
        assert_eq!((stamp_ns, payload.pose.x_m), (seq * 40_000_000, (seq % 100) as f64));
        scans.push(seq);
    }
    scans
}

#[test]
fn the_parts_of_a_run_are_one_log_without_repetition() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("drive.mcap");
    // A restarted recorder receives messages of the history again; the numbers pass 2³².
    let first = u64::from(u32::MAX) - 4;
    write(&path, 7, first..=first + 5, true);
    write(&part_path(&path, 2), 7, first + 2..=first + 9, true);
    std::fs::write(part_path(&path, 3), "").unwrap();
    write(&part_path(&path, 4), 8, 1..=3, false);
    write(&part_path(&path, 5), 7, first + 8..=first + 11, false);
    assert_eq!(scans(&path), (first..=first + 11).collect::<Vec<_>>());

    let summary = info(&path).unwrap();
    assert_eq!(summary.channels[SonarScan::SERVICE.name].messages, 12);
    assert_eq!(summary.channels["robot/pose"].messages, 12);
    // Messages of other streams count as often as they were written.
    assert_eq!(summary.channels[Heartbeat::SERVICE.name].messages, 18);
    let outcomes: Vec<_> = summary.parts.iter().map(|part| (part.path.clone(), part.outcome.clone())).collect();
    let cut = |path: &Path| Outcome::Read(Ending::Cut { offset: std::fs::metadata(path).unwrap().len() });
    assert_eq!(
        outcomes,
        [
            (path.clone(), cut(&path)),
            (part_path(&path, 2), cut(&part_path(&path, 2))),
            (part_path(&path, 3), Outcome::Empty),
            (part_path(&path, 4), Outcome::OtherRun(8)),
            (part_path(&path, 5), Outcome::Read(Ending::Complete)),
        ]
    );
    assert!(summary.to_string().contains("drive.4.mcap: ") && summary.to_string().contains("another run (0000000000000008)"), "{summary}");

    let recovered = folder.path().join("recovered.mcap");
    recover(&path, &recovered).unwrap();
    assert_eq!(scans(&recovered), scans(&path));
    assert!(info(&recovered).unwrap().is_complete());
}

#[test]
fn a_first_file_without_a_message_does_not_hide_the_rest() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("drive.mcap");
    std::fs::write(&path, &mcap::MAGIC[..5]).unwrap();
    write(&part_path(&path, 2), 7, 1..=4, false);
    assert_eq!(scans(&path), [1, 2, 3, 4]);
    assert_eq!(info(&path).unwrap().parts[0].outcome, Outcome::Empty);
}

/// A log of a run in three parts, and what its summary says is missing.
fn missing(change: impl FnOnce(&Path)) -> Vec<String> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("drive.mcap");
    let mut recording = Recording::new(&payloads::preamble(7)).unwrap();
    for number in 1..=3 {
        for seq in 10 * u64::from(number) - 9..=10 * u64::from(number) {
            recording.scan(seq, seq * 40_000_000, &scan(seq)).unwrap();
        }
        let file = if number == 1 { path.clone() } else { part_path(&path, number) };
        if number == 3 {
            std::fs::write(file, recording.finish().unwrap()).unwrap();
            break;
        }
        let (bytes, scene) = recording.finish_part().unwrap();
        std::fs::write(file, bytes).unwrap();
        recording = Recording::after(scene, &[], number + 1, 0, &payloads::preamble(7)).unwrap();
    }
    change(&path);
    let summary = info(&path).unwrap();
    let lines = summary.gaps.lines();
    assert_eq!(summary.is_complete(), lines.is_empty());
    assert!(lines.iter().all(|line| summary.to_string().contains(&format!("missing   {line}"))), "{summary}");
    lines
}

#[test]
fn a_missing_part_of_a_log_is_named() {
    let part = |number: u32| move |path: &Path| std::fs::remove_file(part_path(path, number)).unwrap();
    assert_eq!(missing(|_| ()), [""; 0]);
    assert_eq!(missing(|path| std::fs::remove_file(path).unwrap()), ["part 1 of the log", "robot/scan: 10 messages: 1 to 10"]);
    assert_eq!(missing(part(2)), ["part 2 of the log", "robot/scan: 10 messages: 11 to 20"]);
    assert_eq!(missing(part(3)), ["part 3 of the log"]);
    let all_but_the_last = |path: &Path| {
        std::fs::remove_file(path).unwrap();
        std::fs::remove_file(part_path(path, 2)).unwrap();
    };
    assert_eq!(missing(all_but_the_last), ["parts 1 to 2 of the log", "robot/scan: 20 messages: 1 to 20"]);
    let all_but_the_first = |path: &Path| (2..=3).for_each(|number| part(number)(path));
    assert_eq!(missing(all_but_the_first), ["part 2 of the log"]);
}

#[test]
fn a_later_part_under_another_name_lacks_the_parts_before_it() {
    let renamed = |path: &Path| {
        std::fs::remove_file(part_path(path, 2)).unwrap();
        std::fs::rename(part_path(path, 3), path).unwrap();
    };
    assert_eq!(missing(renamed), ["parts 1 to 2 of the log", "robot/scan: 20 messages: 1 to 20"]);
}

#[test]
fn a_part_that_was_not_written_begins_the_next_one() {
    let mut recording = Recording::new(&payloads::preamble(7)).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("drive.mcap");
    recording.scan(1, 40_000_000, &scan(1)).unwrap();
    recording.flush().unwrap();
    let written = recording.take();
    std::fs::write(&path, &written).unwrap();
    recording.scan(2, 80_000_000, &scan(2)).unwrap();
    recording.tile(1, 80_000_000, &MapTile { cell_m: 0.05, ..MapTile::default() }).unwrap();
    let (unwritten, scene) = recording.finish_part().unwrap();
    // With the bytes that come before it, as if the first write had failed.
    for unwritten in [unwritten.clone(), [written, unwritten].concat()] {
        let mut recording = Recording::after(scene.clone(), &unwritten, 2, 0, &payloads::preamble(7)).unwrap();
        recording.scan(3, 120_000_000, &scan(3)).unwrap();
        std::fs::write(part_path(&path, 2), recording.finish().unwrap()).unwrap();
        assert_eq!(scans(&path), [1, 2, 3]);
        assert_eq!(info(&path).unwrap().gaps.lines(), [""; 0]);
    }
}

#[test]
fn a_part_can_be_read_by_itself() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("drive.mcap");
    write(&path, 7, 1..=4, true);
    write(&part_path(&path, 2), 7, 3..=6, false);
    assert_eq!(scans(&part_path(&path, 2)), [3, 4, 5, 6]);
    assert!(info(&part_path(&path, 2)).unwrap().is_complete());
}

/// The pictures of the map in a file with their stamps.
fn pictures(path: &Path) -> Vec<(u64, Vec<u8>)> {
    let mut log = Log::open(path).unwrap();
    let mut pictures = Vec::new();
    while log.advance().unwrap() {
        let message = log.message().unwrap();
        if message.channel.topic == MapView::topic(0) {
            pictures.push((message.stamp_ns, message.data.to_vec()));
        }
    }
    pictures
}

#[test]
fn the_next_part_begins_with_the_map_and_the_time_of_the_last() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("drive.mcap");
    let mut recording = Recording::new(&payloads::preamble(7)).unwrap();
    recording.scan(1, 40_000_000, &scan(1)).unwrap();
    for (seq, row) in [(1, 0), (2, 3)] {
        recording.tile(seq, 30_000_000 + seq, &MapTile { row, cell_m: 0.05, ..MapTile::default() }).unwrap();
    }
    let (bytes, scene) = recording.finish_part().unwrap();
    std::fs::write(&path, bytes).unwrap();
    let mut recording = Recording::after(scene, &[], 2, 0, &payloads::preamble(7)).unwrap();
    recording.report(5, 6, &Heartbeat::default()).unwrap();
    recording.scan(2, 80_000_000, &scan(2)).unwrap();
    let second = part_path(&path, 2);
    std::fs::write(&second, recording.finish().unwrap()).unwrap();

    assert_eq!(scans(&path), [1, 2]);
    assert!(info(&path).unwrap().is_complete());
    assert_eq!(info(&second).unwrap().channels[Heartbeat::SERVICE.name].first_ns, 40_000_000);
    let [first, last, again] = <[_; 3]>::try_from(pictures(&path)).unwrap();
    assert!(first != last && last == again, "the last map, and not again while it is the same");
    assert_eq!(pictures(&second), [again]);
}

proptest! {
    #[test]
    fn chunks_are_counted_as_the_index_counts_them(flushes in prop::collection::vec((0u64..4, any::<bool>()), 0..10)) {
        let mut recording = Recording::new(&payloads::preamble(1)).unwrap();
        let (mut seq, mut bytes) = (0, Vec::new());
        for (scans, large) in flushes {
            for _ in 0..scans {
                seq += 1;
                recording.scan(seq, seq, &SonarScan::default()).unwrap();
                let layout = messages::FrameLayout::packed(640, 480, messages::PixelFormat::Rgb);
                if large {
                    recording.picture::<messages::CameraFrame>(seq, seq, &layout, &vec![7; layout.bytes()]).unwrap();
                }
            }
            recording.flush().unwrap();
            bytes.extend(recording.take());
        }
        let counted = recording.chunks();
        bytes.extend(recording.finish().unwrap());
        let summary = mcap::Summary::read(&bytes).unwrap().unwrap();
        prop_assert_eq!(counted, summary.chunk_indexes.len() as u64);
    }
}

proptest! {
    #[test]
    fn a_span_has_the_scans_of_the_piece_that_is_cut(
        parts in prop::collection::vec((1_u64..40, 0_u64..10, any::<bool>(), 1_u64..8), 1..5),
        from_ms in 0_u64..4_000,
        length_ms in prop::option::of(0_u64..4_000),
    ) {
        let folder = tempfile::tempdir().unwrap();
        let [log, piece] = ["drive.mcap", "piece.mcap"].map(|name| folder.path().join(name));
        let mut last = 0_u64;
        for (number, (count, again, killed, chunk)) in (1..).zip(&parts) {
            let path = if number == 1 { log.clone() } else { part_path(&log, number) };
            // A restarted recorder receives messages of the history again.
            let first = (last + 1).saturating_sub(*again).max(1);
            write_in_chunks(&path, 7, first..=last + count, *killed, *chunk);
            last += count;
        }
        let span = Span { from_ns: from_ms * 1_000_000, to_ns: length_ms.map(|length_ms| (from_ms + length_ms) * 1_000_000) };
        select(&log, &Selection { span, topics: Vec::new() }, &piece).unwrap();
        let mut found = Log::open(&log).unwrap().within(span);
        prop_assert_eq!(scans_of(&mut found), scans(&piece));
        prop_assert_eq!(found.gaps().lines(), Vec::<String>::new());
    }
}

#[test]
fn what_is_before_a_span_is_not_read() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("drive.mcap");
    write_in_chunks(&path, 7, 1..=100, false, 10);
    write_in_chunks(&part_path(&path, 2), 7, 101..=200, false, 10);
    let mut bytes = std::fs::read(&path).unwrap();
    let chunks = mcap::Summary::read(&bytes).unwrap().unwrap().chunk_indexes.clone();
    for chunk in &chunks[1..] {
        bytes[chunk.chunk_start_offset as usize + 60] ^= 0xff;
    }
    std::fs::write(&path, bytes).unwrap();
    let mut log = Log::open(&path).unwrap().within(Span { from_ns: 150 * 40_000_000, to_ns: None });
    assert_eq!(scans_of(&mut log), (151..=200).collect::<Vec<_>>());
    assert!(log.gaps().is_empty(), "{:?}", log.gaps());
    assert!(Log::open(&path).unwrap().within(Span::default()).next_of::<SonarScan>().is_ok());
    let mut from_the_start = Log::open(&path).unwrap();
    let entries = std::iter::from_fn(|| from_the_start.next_of::<SonarScan>().transpose());
    assert!(entries.take(100).any(|entry| entry.is_err()), "the damage is found");
}
