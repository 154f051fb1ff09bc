//! The Y4M reader.
#![allow(clippy::unwrap_used, clippy::panic, reason = "tests fail by panicking")]

use proptest::prelude::*;
use stillmap_sbs::y4m::{Y4mError, Y4mReader};

/// All frames of a stream, or what is wrong with it.
fn read(bytes: &[u8]) -> Result<Vec<Vec<u8>>, Y4mError> {
    let mut reader = Y4mReader::new(bytes)?;
    let (mut frames, mut luma) = (Vec::new(), Vec::new());
    while reader.read(&mut luma)? {
        frames.push(luma.clone());
    }
    Ok(frames)
}

#[test]
fn the_header_tells_the_time_between_frames() {
    let check = |rate: &str, expected: u64| {
        let header = format!("YUV4MPEG2 W3 H2{rate} Cmono\n");
        assert_eq!(Y4mReader::new(header.as_bytes()).unwrap().period_ns(), expected, "{rate}");
    };
    check("", 66_666_667);
    check(" F0:0", 66_666_667);
    check(" F25:1", 40_000_000);
    check(" F30000:1001", 33_366_666);
    check(" F4294967295:1", 1);
}

#[test]
fn every_colour_space_gives_its_luminance() {
    // Two frames of 5 × 3: the second one is found only where the first one's chroma ends.
    for (name, chroma) in
        [("mono", 0), ("411", 12), ("420mpeg2", 12), ("420paldv", 12), ("422", 18), ("440", 20), ("444", 30), ("444alpha", 45)]
    {
        let mut bytes = format!("YUV4MPEG2 W5 H3 C{name}\n").into_bytes();
        for first in [10, 40] {
            bytes.extend(b"FRAME\n");
            bytes.extend(first..first + 15);
            bytes.extend(std::iter::repeat_n(200, chroma));
        }
        assert_eq!(read(&bytes).unwrap(), [(10..25).collect::<Vec<u8>>(), (40..55).collect()], "{name}");
    }
}

#[test]
fn mono_and_420_give_their_luminance() {
    let mono = read(b"YUV4MPEG2 W3 H2 F15:1 Ip A1:1 Cmono\nFRAME\n\x01\x02\x03\x04\x05\x06FRAME Ip\n\x11\x12\x13\x14\x15\x16").unwrap();
    assert_eq!(mono, [vec![1, 2, 3, 4, 5, 6], vec![0x11, 0x12, 0x13, 0x14, 0x15, 0x16]]);
    let colour = read(b"YUV4MPEG2 W3 H2 C420jpeg\nFRAME\n\x01\x02\x03\x04\x05\x06uuvvFRAME\n\x07\x08\x09\x0a\x0b\x0cuuvv").unwrap();
    assert_eq!(colour, [vec![1, 2, 3, 4, 5, 6], vec![7, 8, 9, 10, 11, 12]]);
    assert_eq!(read(b"YUV4MPEG2 W3 H2\nFRAME\n\x01\x02\x03\x04\x05\x06uuvv").unwrap().len(), 1, "420 is the default");
    assert_eq!(read(b"YUV4MPEG2 W3 H2 Cmono\n").unwrap().len(), 0);
}

#[test]
fn errors_tell_the_offset_and_what_was_expected() {
    let check = |bytes: &[u8], expected: &str| {
        let found = read(bytes).unwrap_err().to_string();
        assert_eq!(found, expected, "{}", String::from_utf8_lossy(bytes));
    };
    check(b"", "at byte 0: found \"\", expected YUV4MPEG2");
    check(b"RIFF\n", "at byte 0: found \"RIFF\", expected YUV4MPEG2");
    check(b"YUV4MPEG2 W3", "at byte 0: found \"YUV4MPEG2 W3\", expected YUV4MPEG2 and its parameters");
    check(b"YUV4MPEG2 W0 H2 Cmono\n", "at byte 10: found \"W0\", expected a width of 1 to 16384");
    check(b"YUV4MPEG2 W3 H99999 Cmono\n", "at byte 13: found \"H99999\", expected a height of 1 to 16384");
    check(b"YUV4MPEG2 W3 Cmono\n", "at byte 0: found \"YUV4MPEG2 W3 Cmono\", expected a width (W) and a height (H)");
    check(b"YUV4MPEG2 W3 H2 C420p10\n", "at byte 16: found \"C420p10\", expected 8-bit mono, 411, 420, 422, 440 or 444");
    check(b"YUV4MPEG2 W3 H2 F15\n", "at byte 16: found \"F15\", expected a frame rate as 15:1");
    check(b"YUV4MPEG2 W3 H2 F0:1\n", "at byte 16: found \"F0:1\", expected a frame rate as 15:1");
    check(b"YUV4MPEG2 W3 H1 Cmono\nFRAME\nabcFRAMX\nabc", "at byte 31: found \"FRAMX\", expected FRAME");
    check(b"YUV4MPEG2 W3 H1 Cmono\nFRAME\nabcFRAME\na", "at byte 38: the stream ends 2 bytes before the end of frame 1");
}

proptest! {
    #[test]
    fn any_bytes_never_panic(tail in proptest::collection::vec(any::<u8>(), 0..200), head in 0_usize..4) {
        let start: &[u8] = [b"".as_slice(), b"YUV4MPEG2", b"YUV4MPEG2 W4 H2 Cmono\n", b"YUV4MPEG2 W4 H2\nFRAME\n"][head];
        let mut bytes = start.to_vec();
        bytes.extend(tail);
        let _ = read(&bytes);
    }

    #[test]
    fn what_was_written_is_read(width in 1_usize..20, height in 1_usize..20, count in 0_usize..5, seed in any::<u8>()) {
        let mut bytes = format!("YUV4MPEG2 W{width} H{height} Cmono\n").into_bytes();
        let frames: Vec<Vec<u8>> = (0..count).map(|k| (0..width * height).map(|i| (i * 7 + k) as u8 ^ seed).collect()).collect();
        for frame in &frames {
            bytes.extend(b"FRAME\n");
            bytes.extend(frame);
        }
        prop_assert_eq!(read(&bytes).unwrap(), frames);
    }
}
