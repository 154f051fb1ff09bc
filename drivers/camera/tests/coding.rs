//! From a device's bytes to luminance.
#![expect(clippy::unwrap_used, reason = "tests fail by panicking")]

use proptest::prelude::*;
use stillmap_camera::{Coding, Damage, FourCc, Shape, Trouble};

const RAMP: &[u8] = include_bytes!("data/ramp_422.jpg");

/// A picture of 160 × 120 of an office, made by us.
const WHOLE: &[u8] = include_bytes!("data/whole.jpg");

/// The luminance that the JPEG picture was made of.
fn ramp() -> Vec<u8> {
    (0..16).flat_map(|v| (0..32).map(move |u| 40 + 4 * u + 5 * v)).collect()
}

fn luminance(shape: Shape, frame: &[u8]) -> Result<Vec<u8>, Damage> {
    let mut luminance = vec![0; shape.pixels()];
    shape.luminance(frame, &mut luminance).map(|()| luminance)
}

#[track_caller]
fn is_the_ramp(frame: &[u8]) {
    let shape = Shape::new(Coding::Mjpg, 32, 16, 0).unwrap();
    let found = luminance(shape, frame).unwrap();
    let worst = found.iter().zip(ramp()).map(|(&found, made)| found.abs_diff(made)).max().unwrap();
    assert!(worst <= 4, "off by {worst}");
}

/// The picture without its Huffman tables, as cameras send it.
fn without_tables() -> Vec<u8> {
    let mut out = RAMP[..2].to_vec();
    let mut at = 2;
    while RAMP[at + 1] != 0xda {
        let end = at + 2 + usize::from(u16::from_be_bytes([RAMP[at + 2], RAMP[at + 3]]));
        if RAMP[at + 1] != 0xc4 {
            out.extend(&RAMP[at..end]);
        }
        at = end;
    }
    out.extend(&RAMP[at..]);
    assert!(out.len() < RAMP.len() - 400);
    out
}

#[test]
fn grey_rows_lose_their_padding() {
    let shape = Shape::new(Coding::Grey, 3, 2, 5).unwrap();
    assert_eq!(luminance(shape, &[1, 2, 3, 90, 91, 4, 5, 6, 92, 93]).unwrap(), [1, 2, 3, 4, 5, 6]);
    // The padding of the last row need not be there.
    assert_eq!(luminance(shape, &[1, 2, 3, 90, 91, 4, 5, 6]).unwrap(), [1, 2, 3, 4, 5, 6]);
}

#[test]
fn of_yuyv_the_luminance_stays() {
    let shape = Shape::new(Coding::Yuyv, 4, 2, 10).unwrap();
    let frame = [1, 90, 2, 91, 3, 92, 4, 93, 0, 0, 5, 94, 6, 95, 7, 96, 8, 97, 0, 0];
    assert_eq!(luminance(shape, &frame).unwrap(), [1, 2, 3, 4, 5, 6, 7, 8]);
}

#[test]
fn jpeg_with_and_without_its_tables() {
    is_the_ramp(RAMP);
    is_the_ramp(&without_tables());
}

#[test]
fn a_frame_that_is_no_picture_is_named() {
    let grey = Shape::new(Coding::Grey, 4, 2, 6).unwrap();
    assert_eq!(luminance(grey, &[0; 9]), Err(Damage::Short { found: 9, expected: 10 }));
    assert_eq!(luminance(grey, &[]), Err(Damage::Short { found: 0, expected: 10 }));
    let jpeg = Shape::new(Coding::Mjpg, 32, 24, 0).unwrap();
    assert_eq!(luminance(jpeg, RAMP), Err(Damage::Size { found: (32, 16), expected: (32, 24) }));
    assert!(matches!(luminance(jpeg, &[]), Err(Damage::Jpeg(_))));
    assert!(matches!(luminance(jpeg, b"no picture at all"), Err(Damage::Jpeg(_))));
    assert!(matches!(luminance(jpeg, &RAMP[..100]), Err(Damage::Jpeg(_))));
}

/// Where the scan's data of a picture begins.
fn data_of(picture: &[u8]) -> usize {
    let at = picture.windows(2).position(|pair| pair == [0xff, 0xda]).unwrap();
    at + 2 + usize::from(u16::from_be_bytes([picture[at + 2], picture[at + 3]]))
}

#[test]
fn a_cut_picture_is_damaged_wherever_it_is_cut() {
    let shape = Shape::new(Coding::Mjpg, 160, 120, 0).unwrap();
    assert!(luminance(shape, WHOLE).is_ok());
    let end = WHOLE.windows(2).rposition(|pair| pair == [0xff, 0xd9]).unwrap();
    let first = data_of(WHOLE);
    for at in (first..end).step_by(29).chain([end]) {
        let cut = luminance(shape, &WHOLE[..at]);
        assert!(matches!(cut, Err(Damage::Cut { .. } | Damage::Jpeg(_))), "at {at} of {}: {cut:?}", WHOLE.len());
    }
    // The end marker alone makes no whole picture.
    for at in (first..end - 60).step_by(29) {
        let closed = luminance(shape, &[&WHOLE[..at], &WHOLE[end..]].concat());
        assert!(matches!(closed, Err(Damage::Incomplete { .. } | Damage::Jpeg(_))), "at {at} of {end}: {closed:?}");
    }
}

#[test]
fn bytes_behind_the_end_are_no_damage() {
    let shape = Shape::new(Coding::Mjpg, 160, 120, 0).unwrap();
    let expect = luminance(shape, WHOLE);
    for padding in [&[0; 1][..], &[0; 900], &[0xff; 7]] {
        assert_eq!(luminance(shape, &[WHOLE, padding].concat()), expect);
    }
    is_the_ramp(&[RAMP, &[0; 64]].concat());
}

#[test]
fn a_shape_that_cannot_be_is_refused() {
    assert_eq!(Shape::new(Coding::Yuyv, 160, 120, 160), Err(Trouble::Stride { stride: 160, row: 320, width: 160 }));
    assert!(Shape::new(Coding::Grey, 0, 120, 160).is_err());
    assert!(Shape::new(Coding::Mjpg, 160, 0, 0).is_err());
}

#[test]
fn codings_have_the_kernel_s_names() {
    assert_eq!(Coding::ALL.map(|coding| coding.four_cc().to_string()), ["GREY", "YUYV", "MJPG"]);
    assert_eq!(Coding::Yuyv.four_cc(), FourCc(0x5659_5559));
    assert_eq!(FourCc(0).to_string(), "\\u{0}".repeat(4));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]

    #[test]
    fn no_bytes_make_it_panic(
        coding in prop::sample::select(&Coding::ALL[..]),
        (width, height, padding) in (1..40_u32, 1..40_u32, 0..9_u32),
        frame in prop::collection::vec(any::<u8>(), 0..4000),
    ) {
        let shape = Shape::new(coding, width, height, 2 * width + padding).unwrap();
        let _ = luminance(shape, &frame);
    }

    #[test]
    fn no_damage_to_a_jpeg_makes_it_panic(
        cut in 0..RAMP.len(),
        flips in prop::collection::vec((0..RAMP.len(), any::<u8>()), 0..8),
    ) {
        let mut frame = RAMP.to_vec();
        for (at, byte) in flips {
            frame[at] = byte;
        }
        let shape = Shape::new(Coding::Mjpg, 32, 16, 0).unwrap();
        let _ = luminance(shape, &frame);
        let _ = luminance(shape, &frame[..cut]);
    }
}
