//! Bytes exchanged between a public client library and a public robot simulator: `tests/data/pioneer/README.md`.
#![allow(clippy::unwrap_used, reason = "tests fail by panicking")]

use std::path::Path;

use stillmap_psos::{Argument, Command, Deframer, Frame, Identity, LinkCounters, RawReading, Sip, number};

fn recording(name: &str) -> Vec<u8> {
    std::fs::read(Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/data/pioneer").join(name)).unwrap()
}

fn frames(bytes: &[u8]) -> (Vec<Frame>, LinkCounters) {
    let mut deframer = Deframer::new();
    (deframer.push(bytes), deframer.counters())
}

fn sips(frames: &[Frame]) -> Vec<Sip> {
    frames.iter().filter_map(|frame| Sip::decode(&frame.data).ok()).collect()
}

#[test]
fn every_byte_of_the_robot_is_understood() {
    for (name, packets, status) in [
        ("aria291-simpleConnect-pty_mobilesim-pion1x.s2c.bin", 36, 32),
        ("aria291-wander_mobilesim-pion1x.s2c.bin", 393, 389),
        ("raw-sync-while-open_mobilesim.s2c.bin", 39, 36),
    ] {
        let (frames, counters) = frames(&recording(name));
        assert_eq!(counters, LinkCounters { packets, bad_checksums: 0, skipped_bytes: 0 }, "{name}");
        assert_eq!(sips(&frames).len(), status, "{name}");
        assert_eq!(frames[0].data, [0]);
        assert_eq!(frames[1].data, [1]);
        let identity = Identity::decode(&frames[2].data).unwrap();
        assert_eq!((identity.name.as_str(), identity.class.as_str(), identity.subclass.as_str()), ("MobileSim", "Pioneer", "pion1x"));
    }
}

#[test]
fn encoding_gives_the_recorded_bytes_again() {
    let bytes = recording("aria291-wander_mobilesim-pion1x.s2c.bin");
    for frame in frames(&bytes).0 {
        let Ok(sip) = Sip::decode(&frame.data) else { continue };
        let packet = sip.encode().unwrap();
        assert_eq!(packet, bytes[frame.start as usize..][..packet.len()]);
    }
}

#[test]
fn the_first_full_packet_is_what_the_readme_says() {
    let sips = sips(&frames(&recording("aria291-wander_mobilesim-pion1x.s2c.bin")).0);
    let sip = &sips[0];
    assert_eq!(sip.readings.len(), 7);
    assert_eq!(sip.readings[3], RawReading { sonar: 3, range: 10784 });
    assert_eq!((sip.status, sip.x, sip.y, sip.heading), (2, 0, 0, 0));
    assert_eq!(sip.tail.len(), 57 - 20 - 21);
}

#[test]
fn silenced_sonars_give_no_readings() {
    let sips = sips(&frames(&recording("raw-sync-while-open_mobilesim.s2c.bin")).0);
    assert_eq!(sips.iter().filter(|sip| sip.readings.is_empty()).count(), 8);
}

#[test]
fn what_a_client_says_is_understood() {
    let (frames, counters) = frames(&recording("aria291-simpleConnect-pty_mobilesim-pion1x.c2s.bin"));
    assert_eq!(counters, LinkCounters { packets: 17, bad_checksums: 0, skipped_bytes: 5 }, "WMS2 and a carriage return");
    let commands: Vec<_> = frames.iter().map(|frame| Command::decode(&frame.data).unwrap()).collect();
    assert_eq!(commands[..3], [Command::plain(number::SYNC0), Command::plain(number::SYNC1), Command::plain(number::SYNC2)]);
    assert_eq!(commands[3], Command::int(number::OPEN, 1));
    assert_eq!(commands.last(), Some(&Command { number: number::CLOSE, argument: Argument::Int(1) }));
}
