//! A log in parts: a recorder that was killed goes on in the next file.
#![allow(clippy::unwrap_used, clippy::panic, reason = "tests fail by panicking")]

mod payloads;

use std::path::Path;

use messages::{Heartbeat, MapTile, Payload, SonarScan};
use proptest::prelude::*;
use stillmap_drivelog::{Ending, Entry, Log, MapView, Outcome, Recording, info, part_path, recover};

fn scan(seq: u64) -> SonarScan {
    SonarScan::new(messages::Pose { x_m: (seq % 100) as f64, ..Default::default() }, &[], false)
}

/// The file of a recorder that saw these scans, killed after the last flush or not.
fn write(path: &Path, run: u64, scans: std::ops::RangeInclusive<u64>, killed: bool) {
    let mut recording = Recording::new(&payloads::preamble(run)).unwrap();
    for seq in scans {
        recording.scan(seq, seq * 40_000_000, &scan(seq)).unwrap();
        recording.report(1, seq, &Heartbeat::default()).unwrap();
    }
    recording.flush().unwrap();
    let mut bytes = recording.take();
    if !killed {
        bytes.extend(recording.finish().unwrap());
    }
    std::fs::write(path, bytes).unwrap();
}

fn scans(path: &Path) -> Vec<u64> {
    let mut log = Log::open(path).unwrap();
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
    // The history of the bus gives a restarted recorder again what it had before; numbers pass 2³² on the way.
    let first = u64::from(u32::MAX) - 4;
    write(&path, 7, first..=first + 5, true);
    write(&part_path(&path, 2), 7, first + 2..=first + 9, true);
    std::fs::write(part_path(&path, 3), "").unwrap();
    write(&part_path(&path, 4), 8, 1..=3, false);
    write(&part_path(&path, 5), 7, first + 8..=first + 11, false);
    assert_eq!(scans(&path), (first..=first + 11).collect::<Vec<_>>());

    let told = info(&path).unwrap();
    assert_eq!(told.channels[SonarScan::SERVICE.name].messages, 12);
    assert_eq!(told.channels["robot/pose"].messages, 12);
    // What is no numbered stream is told as often as it was written.
    assert_eq!(told.channels[Heartbeat::SERVICE.name].messages, 18);
    let outcomes: Vec<_> = told.parts.iter().map(|part| (part.path.clone(), part.outcome.clone())).collect();
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
    assert!(told.to_string().contains("drive.4.mcap: ") && told.to_string().contains("another run (0000000000000008)"), "{told}");

    let whole = folder.path().join("whole.mcap");
    recover(&path, &whole).unwrap();
    assert_eq!(scans(&whole), scans(&path));
    assert!(info(&whole).unwrap().is_whole());
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

#[test]
fn a_part_can_be_read_by_itself() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("drive.mcap");
    write(&path, 7, 1..=4, true);
    write(&part_path(&path, 2), 7, 3..=6, false);
    assert_eq!(scans(&part_path(&path, 2)), [3, 4, 5, 6]);
}

/// The pictures of the map in a file: when, and what they show.
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
fn a_log_that_goes_on_in_another_file_begins_with_the_map_and_the_time_that_it_had() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("drive.mcap");
    let mut recording = Recording::new(&payloads::preamble(7)).unwrap();
    recording.scan(1, 40_000_000, &scan(1)).unwrap();
    for (seq, row) in [(1, 0), (2, 3)] {
        recording.tile(seq, 30_000_000 + seq, &MapTile { row, cell_m: 0.05, ..MapTile::default() }).unwrap();
    }
    let (bytes, scene) = recording.finish_part().unwrap();
    std::fs::write(&path, bytes).unwrap();
    let mut recording = Recording::after(scene, &payloads::preamble(7)).unwrap();
    recording.report(5, 6, &Heartbeat::default()).unwrap();
    recording.scan(2, 80_000_000, &scan(2)).unwrap();
    let second = part_path(&path, 2);
    std::fs::write(&second, recording.finish().unwrap()).unwrap();

    assert_eq!(scans(&path), [1, 2]);
    assert!(info(&path).unwrap().is_whole());
    assert_eq!(info(&second).unwrap().channels[Heartbeat::SERVICE.name].first_ns, 40_000_000);
    let [first, whole, again] = <[_; 3]>::try_from(pictures(&path)).unwrap();
    assert!(first != whole && whole == again, "the map as it was, and not once more while it stays so");
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
