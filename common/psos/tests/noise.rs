//! Whatever comes over the line: no panic, no good packet lost, no difference by how the bytes are cut.
#![allow(clippy::unwrap_used, reason = "tests fail by panicking")]

use std::ops::Range;

use proptest::collection::vec;
use proptest::prelude::*;
use stillmap_psos::{Command, Deframer, Frame, Identity, Sip, checksum, encode_frame};

fn packet_data() -> impl Strategy<Value = Vec<u8>> {
    vec(any::<u8>(), 1..=198)
}

/// Noise that tempts: many header bytes, wrong counts.
fn noise() -> impl Strategy<Value = Vec<u8>> {
    vec(prop_oneof![3 => any::<u8>(), 2 => Just(0xFA), 2 => Just(0xFB), 1 => Just(3)], 0..120)
}

/// A stream of noise and packets, with the places of the packets.
fn stream() -> impl Strategy<Value = (Vec<u8>, Vec<Range<usize>>)> {
    vec((noise(), packet_data()), 1..8).prop_map(|parts| {
        let mut bytes = Vec::new();
        let mut packets = Vec::new();
        for (noise, data) in parts {
            bytes.extend(noise);
            let start = bytes.len();
            bytes.extend(encode_frame(&data).unwrap());
            packets.push(start..bytes.len());
        }
        (bytes, packets)
    })
}

fn place(frame: &Frame) -> Range<usize> {
    let start = frame.start as usize;
    start..start + frame.data.len() + 5
}

/// The packet as it is on the wire. A robot may send more data than [`encode_frame`] makes.
fn packet_bytes(data: &[u8]) -> Vec<u8> {
    let mut packet = vec![0xFA, 0xFB, data.len() as u8 + 2];
    packet.extend(data);
    packet.extend(checksum(data).to_be_bytes());
    packet
}

/// Found, or cut by another packet whose checksum agrees: `FA FB 03 FA 00` before a packet makes one with its first byte.
fn is_found_or_cut(packet: &Range<usize>, found: &[Frame]) -> bool {
    found.iter().map(place).any(|other| other.start < packet.end && packet.start < other.end)
}

#[test]
fn packets_up_to_the_longest_count_are_read() {
    for length in [198, 199, 207, 253] {
        let data = vec![7; length];
        assert_eq!(Deframer::new().push(&packet_bytes(&data)), [Frame { start: 0, data }]);
    }
}

#[test]
fn noise_that_completes_a_packet_counts_as_one() {
    let mut bytes = vec![0xFA, 0xFB, 0x03, 0xFA, 0x00];
    bytes.extend(encode_frame(&[7]).unwrap());
    assert_eq!(Deframer::new().push(&bytes), [Frame { start: 0, data: vec![0xFA] }]);
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 512, ..ProptestConfig::default() })]

    #[test]
    fn every_good_packet_inside_noise_is_found((bytes, packets) in stream()) {
        let found = Deframer::new().push(&bytes);
        prop_assert!(packets.iter().all(|packet| is_found_or_cut(packet, &found)));
        prop_assert!(found.windows(2).all(|pair| place(&pair[0]).end <= place(&pair[1]).start), "none overlaps another");
    }

    #[test]
    fn cuts_make_no_difference((bytes, _) in stream(), cuts in vec(1_usize..40, 1..60)) {
        let mut whole = Deframer::new();
        let expect = whole.push(&bytes);
        let mut cut = Deframer::new();
        let mut found = Vec::new();
        let mut rest = bytes.as_slice();
        for length in cuts.iter().cycle() {
            if rest.is_empty() { break }
            let (now, later) = rest.split_at((*length).min(rest.len()));
            found.extend(cut.push(now));
            rest = later;
        }
        prop_assert_eq!(found, expect);
        prop_assert_eq!(cut.counters(), whole.counters());
    }

    #[test]
    fn every_byte_is_accounted_for((bytes, _) in stream()) {
        let mut deframer = Deframer::new();
        let found = deframer.push(&bytes);
        let in_packets: u64 = found.iter().map(|frame| frame.data.len() as u64 + 5).sum();
        let open = deframer.position() - deframer.open_from();
        prop_assert_eq!(in_packets + deframer.counters().skipped_bytes + open, bytes.len() as u64);
        prop_assert_eq!(deframer.position(), bytes.len() as u64);
        for frame in found {
            let packet = packet_bytes(&frame.data);
            prop_assert_eq!(&bytes[frame.start as usize..][..packet.len()], packet.as_slice());
        }
    }

    #[test]
    fn no_bytes_harm(bytes in vec(any::<u8>(), 0..600)) {
        Deframer::new().push(&bytes);
        let _ = Sip::decode(&bytes);
        let _ = Command::decode(&bytes);
        let _ = Identity::decode(&bytes);
    }

    #[test]
    fn a_status_packet_survives_any_tail(bytes in vec(any::<u8>(), 20..120), count in 0_u8..30) {
        let mut data = bytes;
        data[0] = 0x32;
        data[19] = count;
        match Sip::decode(&data) {
            Ok(sip) => prop_assert_eq!(&sip.encode().unwrap()[3..3 + data.len()], data.as_slice()),
            Err(_) => prop_assert!(data.len() < 20 + 3 * usize::from(count)),
        }
    }
}
