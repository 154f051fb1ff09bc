//! Bytes of a log that were cut or changed, each at every place: what is left is read, what is lost is noticed, nothing is
//! made up, and nothing panics.

use messages::{MapTile, Pose, SonarReading, SonarScan};

use crate::damage::Fault;
use crate::logged::Logged;
use crate::part::{Ending, PartReader};
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
    let mut part = PartReader::new(bytes)?;
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
        let whole = flushed.iter().rev().find(|(size, _)| *size <= length);
        match (read(&bytes[..length]), whole) {
            (Ok(found), Some((_, count))) => {
                assert!(found.faults.is_empty(), "cut at {length}: {:?}", found.faults);
                assert!(found.scans.len() as u64 >= *count, "cut at {length}: {} scans, {count} were flushed", found.scans.len());
                let expected: Vec<_> = (1..).zip(scans.iter().copied()).take(found.scans.len()).collect();
                assert_eq!(found.scans, expected, "cut at {length}");
                assert!(matches!(found.ending, Ending::Cut { offset } if offset <= length as u64), "cut at {length}: {:?}", found.ending);
            }
            (Err(Fault::CutAtStart { offset }), None) => assert!(offset <= length as u64),
            (read, whole) => panic!("cut at {length}, whole {whole:?}: {:?}", read.map(|found| found.ending)),
        }
    }
    assert_eq!(read(&bytes).unwrap().ending, Ending::Complete);
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
