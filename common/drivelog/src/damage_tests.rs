//! Logs cut or changed at every byte: the rest is read, every loss is reported, no message is invented, and nothing panics.

use std::ops::Range;

use messages::{MapTile, Pose, SonarReading, SonarScan};

use crate::damage::{Damage, Fault};
use crate::deframer::opcode;
use crate::ending::Ending;
use crate::logged::Logged;
use crate::part::PartReader;
use crate::preamble::Preamble;
use crate::recording::Recording;

const SCANS: u64 = 6;
/// Scans between two flushes.
const HELD: u64 = 2;

struct Example {
    bytes: Vec<u8>,
    scans: Vec<SonarScan>,
    /// Size of the file after each flush, and the scans written by then.
    flushed: Vec<(usize, u64)>,
    /// Where the data end and the index begins.
    index: usize,
}

fn example() -> Example {
    let ring = vec![Pose { x_m: 0.1, y_m: 0.2, yaw_rad: 0.3 }];
    let preamble = Preamble { run: 7, robot: "x".into(), sonars: ring, origin: "a test".into(), settings: "name = \"x\"".into() };
    let reading = SonarReading { range_m: 1.5, echo: 1, ..SonarReading::default() };
    let scan = |seq| SonarScan::new(Pose { x_m: 1.0 / seq as f64, ..Pose::default() }, &[reading], false);
    let scans: Vec<SonarScan> = (1..=SCANS).map(scan).collect();
    let tile = MapTile { cell_m: 0.05, ..MapTile::default() };
    let mut recording = Recording::new(&preamble).unwrap();
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
    bytes.extend(recording.finish().unwrap());
    let footer = bytes.len() - mcap::MAGIC.len() - 20;
    let summary = u64::from_le_bytes(bytes[footer..footer + 8].try_into().unwrap());
    let data_end_record = 9 + 4;
    Example { index: usize::try_from(summary).unwrap() - data_end_record, bytes, scans, flushed }
}

/// What reading gives.
struct Found {
    scans: Vec<(u64, SonarScan)>,
    faults: Vec<Fault>,
    ending: Ending,
}

fn read(bytes: &[u8]) -> Result<Found, Fault> {
    let mut part = PartReader::new(std::io::Cursor::new(bytes))?;
    let (mut scans, mut faults) = (Vec::new(), Vec::new());
    loop {
        match part.advance() {
            Ok(true) => {
                let message = part.message().unwrap();
                if message.channel.topic == "robot/scan" {
                    scans.push(SonarScan::decode(message.data).unwrap());
                }
            }
            Ok(false) => return Ok(Found { scans, faults, ending: part.ending().unwrap().clone() }),
            Err(fault) => faults.push(fault),
        }
    }
}

#[test]
fn a_log_cut_anywhere_is_read_up_to_the_last_flush() {
    let Example { bytes, scans, flushed, .. } = example();
    for length in 0..bytes.len() {
        let readable = flushed.iter().rev().find(|(size, _)| *size <= length);
        match (read(&bytes[..length]), readable) {
            (Ok(found), Some((_, count))) => {
                assert!(found.faults.is_empty(), "cut at {length}: {:?}", found.faults);
                assert!(found.scans.len() as u64 >= *count, "cut at {length}: {} scans, {count} were flushed", found.scans.len());
                let expected: Vec<_> = (1..).zip(scans.iter().copied()).take(found.scans.len()).collect();
                assert_eq!(found.scans, expected, "cut at {length}");
                assert!(matches!(found.ending, Ending::Cut { offset } if offset <= length as u64), "cut at {length}: {:?}", found.ending);
            }
            (Err(Fault::CutAtStart { offset }), None) => assert!(offset <= length as u64),
            (read, readable) => panic!("cut at {length}, readable {readable:?}: {:?}", read.map(|found| found.ending)),
        }
    }
    assert_eq!(read(&bytes).unwrap().ending, Ending::Complete);
}

/// As a power cut leaves a file whose length was on the disk before its last bytes.
#[test]
fn zeros_after_a_flush_are_a_cut() {
    let Example { bytes, scans, flushed, .. } = example();
    for (size, count) in flushed {
        for zeros in [1, 9, 100, 4096, 100_000] {
            let mut cut = bytes[..size].to_vec();
            cut.resize(size + zeros, 0);
            let found = read(&cut).unwrap();
            assert_eq!((found.ending, found.faults.len()), (Ending::Cut { offset: size as u64 }, 0), "{zeros} zeros behind {size}");
            assert_eq!(found.scans.len() as u64, count);
            assert!(found.scans.iter().all(|(seq, scan)| scans.get(usize::try_from(seq - 1).unwrap()) == Some(scan)));
            cut.push(1);
            assert!(matches!(read(&cut).unwrap().ending, Ending::Damaged(_)), "{zeros} zeros and a byte");
        }
    }
}

#[test]
fn a_file_of_zeros_is_cut_before_its_first_message() {
    for zeros in [1, 8, 4096, 1024 * 1024] {
        assert!(matches!(read(&vec![0; zeros]), Err(Fault::CutAtStart { .. })), "{zeros} zeros");
    }
    let foreign = [vec![0; 4096], vec![1]].concat();
    assert!(matches!(read(&foreign), Err(Fault::Damaged(_))));
    assert!(matches!(read(&vec![0; 2 * 1024 * 1024]), Err(Fault::Damaged(_))), "no log, however long");
}

#[test]
fn a_flipped_bit_anywhere_is_noticed_and_makes_no_scan_up() {
    let Example { bytes, scans, flushed, index } = example();
    let (start, _) = flushed[0];
    for place in 0..bytes.len() {
        for bit in 0..8 {
            let mut damaged = bytes.clone();
            damaged[place] ^= 1 << bit;
            match read(&damaged) {
                Ok(found) => {
                    let noticed = !found.faults.is_empty() || found.ending != Ending::Complete;
                    assert!(noticed || place >= index, "bit {bit} of byte {place} flips unnoticed");
                    for (seq, scan) in &found.scans {
                        assert_eq!(scans.get(usize::try_from(seq - 1).unwrap()), Some(scan), "bit {bit} of byte {place}");
                    }
                }
                Err(fault) => assert!(place < start, "bit {bit} of byte {place}: {fault}"),
            }
        }
    }
}

/// The scans of the chunks that a hole does not touch.
fn spared(Example { scans, flushed, .. }: &Example, hole: &Range<usize>) -> Vec<(u64, SonarScan)> {
    let is_spared = |seq: u64| {
        let mut chunks = flushed.windows(2);
        chunks.any(|ends| (ends[0].1 + 1..=ends[1].1).contains(&seq) && (hole.end <= ends[0].0 || hole.start >= ends[1].0))
    };
    (1..).zip(scans.iter().copied()).filter(|(seq, _)| is_spared(*seq)).collect()
}

fn with_zeros(bytes: &[u8], hole: Range<usize>) -> Vec<u8> {
    let mut damaged = bytes.to_vec();
    damaged[hole].fill(0);
    damaged
}

/// The first chunk tells what the messages of all are.
#[test]
fn a_hole_costs_only_the_chunks_that_it_touches() {
    let example = example();
    let Example { bytes, scans, flushed, index } = &example;
    let (first_chunk, chunk) = (flushed[1].0, flushed[2].0 - flushed[1].0);
    for length in [1, 9, 60, chunk, chunk + 30] {
        for start in (first_chunk..bytes.len() - length).step_by(3) {
            let hole = start..start + length;
            let damaged = with_zeros(bytes, hole.clone());
            let found = read(&damaged).unwrap();
            let noticed = !found.faults.is_empty() || found.ending != Ending::Complete || damaged == *bytes;
            assert!(noticed || start + length > *index, "a hole of {hole:?} is not noticed");
            let spared = spared(&example, &hole);
            assert!(spared.iter().all(|scan| found.scans.contains(scan)), "a hole of {hole:?}: {:?}", found.faults);
            assert!(found.scans.iter().all(|(seq, scan)| scans[*seq as usize - 1] == *scan), "a hole of {hole:?}");
            assert!(found.scans.is_sorted_by_key(|(seq, _)| *seq), "a hole of {hole:?}");
        }
    }
}

#[test]
fn bytes_that_are_passed_over_are_counted() {
    let Example { bytes, flushed, .. } = example();
    let (second, third) = (flushed[1].0, flushed[2].0);
    let skipped = |faults: &[Fault]| {
        let of = |fault: &Fault| if let Fault::Damaged(damage) = fault { (damage.offset, damage.skipped) } else { (0, 0) };
        faults.iter().map(of).collect::<Vec<_>>()
    };
    let found = read(&with_zeros(&bytes, second..second + 100)).unwrap();
    assert_eq!(skipped(&found.faults), [(second as u64, (third - second) as u64)]);
    assert_eq!(found.ending, Ending::Complete);
    let said = found.faults[0].to_string();
    assert!(
        said.contains("found a record of type 0x00") && said.ends_with(&format!("; {} bytes are passed over", third - second)),
        "{said}"
    );
    let found = read(&with_zeros(&with_zeros(&bytes, second..second + 9), third..third + 9)).unwrap();
    assert_eq!((found.scans.len() as u64, found.faults.len()), (HELD, 1), "both are one gap");
    let end = bytes.len() as u64;
    let footer = bytes.len() - 40;
    let found = read(&[&bytes[..footer], &[0xee; 40]].concat()).unwrap();
    assert_eq!(found.scans.len() as u64, SCANS, "the footer holds nothing");
    assert!(matches!(found.ending, Ending::Damaged(Damage { offset, skipped, .. }) if offset + skipped == end), "{:?}", found.ending);
    let found = read(&with_zeros(&bytes, footer..bytes.len())).unwrap();
    assert_eq!(found.scans.len() as u64, SCANS);
    assert!(matches!(found.ending, Ending::Cut { offset } if offset < end), "{:?}", found.ending);
}

#[test]
fn a_length_that_is_damaged_takes_no_other_chunk_with_it() {
    let Example { bytes, scans, flushed, .. } = example();
    let second = flushed[1].0;
    let expected: Vec<_> = (1..).zip(scans).filter(|(seq, _)| !(HELD + 1..=2 * HELD).contains(seq)).collect();
    let with_the_third = (flushed[3].0 - second - 9) as u64;
    for length in [0, 1, 300, with_the_third - 50, with_the_third, 1 << 20, 60 << 20, 1 << 40] {
        let mut damaged = bytes.clone();
        damaged[second + 1..second + 9].copy_from_slice(&length.to_le_bytes());
        let found = read(&damaged).unwrap();
        assert_eq!(found.scans, expected, "{length}: {:?}", found.faults);
        assert!(!found.faults.is_empty() && found.ending == Ending::Complete, "{length}: {:?}", found.ending);
    }
}

#[test]
fn a_chunk_that_says_it_is_larger_than_anything_is_none() {
    let Example { mut bytes, flushed, .. } = example();
    bytes.truncate(flushed[1].0);
    bytes.extend([0, opcode::CHUNK]);
    bytes.extend(40_u64.to_le_bytes());
    bytes.extend([0; 32]);
    bytes.extend(u64::MAX.to_le_bytes());
    assert_eq!(read(&bytes).unwrap().scans.len() as u64, HELD);
}

/// Each of these says that it is a chunk of all that follows: unpacking it for every one would take hours.
#[test]
fn unpacking_of_false_chunks_is_bounded() {
    let Example { mut bytes, flushed, .. } = example();
    bytes.truncate(flushed[1].0);
    bytes.push(0);
    const COUNT: u64 = 300_000;
    const SIZE: u64 = 9 + 40;
    for number in 0..COUNT {
        let length = (COUNT - number) * SIZE - 9;
        bytes.push(opcode::CHUNK);
        bytes.extend(length.to_le_bytes());
        bytes.extend([0; 16]);
        bytes.extend((length - 40).to_le_bytes());
        bytes.extend([1; 4]);
        bytes.extend([0; 4]);
        bytes.extend((length - 40).to_le_bytes());
    }
    let found = read(&bytes).unwrap();
    assert_eq!(found.scans.len() as u64, HELD);
    assert!(matches!(found.ending, Ending::Damaged(_)), "{:?}", found.ending);
}
