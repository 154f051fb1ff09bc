//! Every payload comes back from a log as it went in, bit for bit, with its number and its stamp.
#![allow(clippy::unwrap_used, clippy::panic, reason = "tests fail by panicking")]

mod payloads;

use core::convert::Infallible;

use messages::{FilterVerdict, Heartbeat, LogLine, MapTile, Payload, Pictures, Progress, SonarScan, TruthScan};
use proptest::prelude::*;
use proptest::test_runner::TestRng;
use stillmap_drivelog::{Entry, Log, LogVisitor, Logged, Recording, visit_logged};

/// Encodes and decodes a payload of every service.
struct RoundTrip<'a> {
    rng: &'a mut TestRng,
    services: usize,
}

impl LogVisitor for RoundTrip<'_> {
    type Error = Infallible;

    fn message<T: Logged>(&mut self) -> Result<(), Infallible> {
        let mut payload: T = payloads::any_payload(self.rng);
        // Levels of a log line are few, and are stored in fewer bits.
        if let Some(line) = (&mut payload as &mut dyn core::any::Any).downcast_mut::<LogLine>() {
            line.level %= 5;
        }
        let (seq, stamp_ns) = (self.rng.random(), self.rng.random());
        let (found_seq, found) = T::decode(&payload.encode(seq, stamp_ns)).unwrap();
        assert_eq!(found_seq, seq, "{}", T::SERVICE.name);
        assert!(bytemuck::bytes_of(&found) == bytemuck::bytes_of(&payload), "{}: {payload:?} became {found:?}", T::SERVICE.name);
        self.services += 1;
        Ok(())
    }

    fn pictures<P: Pictures>(&mut self) -> Result<(), Infallible> {
        Ok(())
    }
}

proptest! {
    #[test]
    fn every_payload_is_decoded_as_it_was_encoded(rng in Just(()).prop_perturb(|(), rng| rng)) {
        let mut rng = rng;
        let mut round_trip = RoundTrip { rng: &mut rng, services: 0 };
        let Ok(()) = visit_logged(&mut round_trip);
        prop_assert!(round_trip.services > 10);
    }
}

/// What the bus lets through and JSON has no number for does not make a log unreadable.
#[test]
fn a_number_that_is_none_comes_back_as_none() {
    let mut truth = TruthScan { walkers_count: 1, ..TruthScan::default() };
    truth.walkers_m[0] = [f64::NAN, f64::INFINITY];
    let (_, found) = TruthScan::decode(&truth.encode(1, 2)).unwrap();
    assert!(found.walkers_m[0].iter().all(|value| value.is_nan()));
}

#[test]
fn the_json_of_a_scan_reads_as_the_payload_does() {
    let reading =
        messages::SonarReading { mount: messages::Pose { x_m: 0.1, y_m: -0.25, yaw_rad: 1.5 }, range_m: 2.125, sonar: 6, echo: 1 };
    let scan = SonarScan::new(messages::Pose { x_m: 1e-3, y_m: 1e300, yaw_rad: -0.0 }, &[reading], true);
    let expected = r#"{"seq":7,"pose":{"x_m":0.001,"y_m":1e+300,"yaw_rad":-0.0},"after_gap":1,"readings":[{"mount":{"x_m":0.1,"y_m":-0.25,"yaw_rad":1.5},"range_m":2.125,"sonar":6,"echo":1}]}"#;
    assert_eq!(String::from_utf8(scan.encode(7, 0)).unwrap(), expected);
}

proptest! {
    /// Through a whole file, in order, among messages of other services.
    #[test]
    fn a_stream_comes_back_in_order(
        scans in prop::collection::vec((any::<u64>(), payloads::scan()), 0..20),
        tiles in prop::collection::vec(payloads::tile(), 0..3),
        first in 1..u64::MAX / 2,
    ) {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("drive.mcap");
        let mut recording = Recording::new(&payloads::preamble(1)).unwrap();
        for (seq, (stamp_ns, scan)) in (first..).zip(&scans) {
            recording.scan(seq, *stamp_ns, scan).unwrap();
            recording.report(1, 0, &Progress::default()).unwrap();
        }
        for tile in &tiles {
            recording.tile(9, 8, tile).unwrap();
        }
        recording.end::<SonarScan>(99, 77).unwrap();
        recording.end::<TruthScan>(98, 76).unwrap();
        std::fs::write(&path, recording.finish().unwrap()).unwrap();

        let mut log = Log::open(&path).unwrap();
        prop_assert_eq!(log.preamble(), &payloads::preamble(1));
        for (expected_seq, (expected_stamp, expected)) in (first..).zip(&scans) {
            let Some(Entry::Message { seq, stamp_ns, payload }) = log.next_of::<SonarScan>().unwrap() else { panic!("a message") };
            prop_assert_eq!((seq, stamp_ns), (expected_seq, *expected_stamp));
            prop_assert_eq!(bytemuck::bytes_of(&payload), bytemuck::bytes_of(expected));
        }
        prop_assert_eq!(log.next_of::<SonarScan>().unwrap(), Some(Entry::End { seq: 99, stamp_ns: 77 }));
        prop_assert_eq!(log.next_of::<SonarScan>().unwrap(), None);

        let mut log = Log::open(&path).unwrap();
        for expected in &tiles {
            let Some(Entry::Message { payload, .. }) = log.next_of::<MapTile>().unwrap() else { panic!("a tile") };
            prop_assert_eq!(bytemuck::bytes_of(&payload), bytemuck::bytes_of(expected));
        }
        prop_assert_eq!(log.next_of::<MapTile>().unwrap(), None);
        prop_assert_eq!(stillmap_drivelog::info(&path).unwrap().channels.get(SonarScan::SERVICE.name).map_or(0, |c| c.messages), scans.len() as u64);
    }
}

/// Foxglove and Lichtblick report an error for a list in a list.
struct NoListInList(usize);

impl NoListInList {
    fn check(&mut self, schema: &serde_json::Value) {
        assert!(schema["type"] != "array" || schema["items"]["type"] != "array", "{schema}");
        self.0 += usize::from(schema["type"] == "array");
        schema["properties"].as_object().into_iter().flatten().for_each(|(_, schema)| self.check(schema));
        if schema["items"].is_object() {
            self.check(&schema["items"]);
        }
    }
}

impl LogVisitor for NoListInList {
    type Error = Infallible;

    fn message<T: Logged>(&mut self) -> Result<(), Infallible> {
        let format = T::format();
        if format.schema_encoding == "jsonschema" {
            self.check(&serde_json::from_slice(&format.schema).unwrap());
        }
        Ok(())
    }

    fn pictures<P: Pictures>(&mut self) -> Result<(), Infallible> {
        Ok(())
    }
}

#[test]
fn no_schema_has_a_list_in_a_list() {
    let mut visitor = NoListInList(0);
    let Ok(()) = visit_logged(&mut visitor);
    assert!(visitor.0 > 5, "{} lists", visitor.0);
}

/// Heartbeats carry no sensor time: a log must not seem to begin in 1970 for their sake.
#[test]
fn reports_stand_among_the_sensor_messages_before_them() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("drive.mcap");
    let mut recording = Recording::new(&payloads::preamble(1)).unwrap();
    recording.report(1, 0, &Progress::default()).unwrap();
    recording.scan(1, 5_000, &SonarScan::default()).unwrap();
    recording.report(2, 9_999, &Progress::default()).unwrap();
    recording.scan(2, 6_000, &SonarScan::default()).unwrap();
    std::fs::write(&path, recording.finish().unwrap()).unwrap();
    assert_eq!(stillmap_drivelog::info(&path).unwrap().span_ns(), Some((5_000, 6_000)));
    let mut log = Log::open(&path).unwrap();
    for expected in [(1, 0), (2, 9_999)] {
        let Some(Entry::Message { seq, stamp_ns, .. }) = log.next_of::<Progress>().unwrap() else { panic!("a report") };
        assert_eq!((seq, stamp_ns), expected);
    }
}

#[test]
fn messages_are_in_the_order_of_their_log_times() {
    let mut recording = Recording::new(&payloads::preamble(7)).unwrap();
    recording.report(1, 9, &Heartbeat::default()).unwrap();
    // Answers have the stamps of earlier scans.
    for seq in 1..=20_u64 {
        recording.scan(seq, seq * 1_000, &SonarScan::default()).unwrap();
        recording.add(seq, seq.saturating_sub(3) * 1_000, &FilterVerdict::default()).unwrap();
        recording.tile(seq, seq.saturating_sub(5) * 1_000, &MapTile { cell_m: 0.05, ..MapTile::default() }).unwrap();
    }
    recording.end::<FilterVerdict>(20, 17_000).unwrap();
    let log = recording.finish().unwrap();
    let messages: Vec<_> = mcap::MessageStream::new(&log).unwrap().map(Result::unwrap).collect();
    assert!(messages.is_sorted_by_key(|message| message.log_time));
    let verdicts = messages.iter().filter(|message| message.channel.topic == "map/verdict");
    let stamps: Vec<u64> = verdicts.map(|message| message.publish_time).collect();
    assert_eq!(stamps, (1..=20_u64).map(|seq| seq.saturating_sub(3) * 1_000).collect::<Vec<_>>());
}
