//! Payloads of all kinds, valid ones where validity is checked by a log.
#![allow(dead_code, reason = "each test file uses its part")]

use bytemuck::Pod;
use messages::{Layout, MapTile, Pose, Shape, SonarReading, SonarScan, TILE_CELLS};
use proptest::collection::vec;
use proptest::prelude::*;
use proptest::test_runner::TestRng;
use stillmap_drivelog::Preamble;

/// A preamble of a run.
pub(crate) fn preamble(run: u64) -> Preamble {
    Preamble {
        run,
        robot: "pioneer-1".to_owned(),
        sonars: [90.0_f64, 15.0, -15.0].map(|deg| Pose { x_m: 0.1, y_m: 1.0 / 3.0, yaw_rad: deg.to_radians() }).to_vec(),
        origin: "recorded by a test".to_owned(),
        settings: "name = \"test\"\npace = \"lockstep\"\n".to_owned(),
    }
}

/// A payload with finite numbers, texts and lists of any length; numbers are subnormal and negative zero, too.
pub(crate) fn any_payload<T: Layout + Pod>(rng: &mut TestRng) -> T {
    let mut payload = T::zeroed();
    fill(&T::SHAPE, bytemuck::bytes_of_mut(&mut payload), usize::MAX, rng);
    payload
}

/// Fills so many entries of an array, or anything else.
fn fill(shape: &Shape, bytes: &mut [u8], entries: usize, rng: &mut TestRng) {
    match shape {
        Shape::U8 | Shape::U32 | Shape::U64 | Shape::I32 => rng.fill_bytes(&mut bytes[..shape.size()]),
        Shape::F32 => until(bytes, rng, |bytes: [u8; 4]| f32::from_ne_bytes(bytes).is_finite()),
        Shape::F64 => until(bytes, rng, |bytes: [u8; 8]| f64::from_ne_bytes(bytes).is_finite()),
        Shape::Text(most) => {
            let text =
                ["", "std", "“Größe” \\ \u{1} \u{10ffff}", "a longer text without end, which is cut where it must"][rng.random_range(0..4)];
            let end = (0..=text.len().min(*most)).rev().find(|end| text.is_char_boundary(*end)).unwrap();
            bytes[..end].copy_from_slice(&text.as_bytes()[..end]);
        }
        Shape::Array(entry, count) => {
            bytes.chunks_exact_mut(entry.size()).take(*count).take(entries).for_each(|bytes| fill(entry, bytes, usize::MAX, rng));
        }
        Shape::Struct { fields, .. } => {
            for field in *fields {
                let (Shape::Array(_, room), Some(at)) = (&field.shape, field.count) else {
                    if field.name != "reserved" && fields.iter().all(|list| list.count != Some(field.offset)) {
                        fill(&field.shape, &mut bytes[field.offset..], usize::MAX, rng);
                    }
                    continue;
                };
                let count = rng.random_range(0..=*room);
                bytes[at..at + 4].copy_from_slice(&(count as u32).to_ne_bytes());
                fill(&field.shape, &mut bytes[field.offset..], count, rng);
            }
        }
    }
}

fn until<const N: usize>(bytes: &mut [u8], rng: &mut TestRng, is_good: impl Fn([u8; N]) -> bool) {
    loop {
        rng.fill_bytes(&mut bytes[..N]);
        if is_good(*bytes.first_chunk().unwrap()) {
            return;
        }
    }
}

/// Scans that a log takes for valid.
pub(crate) fn scan() -> impl Strategy<Value = SonarScan> {
    let mount = (-10.0..=10.0, -10.0..=10.0, -10.0..=10.0).prop_map(|(x_m, y_m, yaw_rad)| Pose { x_m, y_m, yaw_rad });
    let reading =
        (mount, 0.0..=10.0, 0..=255u32, 0..=1u32).prop_map(|(mount, range_m, sonar, echo)| SonarReading { mount, range_m, sonar, echo });
    let yaw_rad = prop::num::f64::ANY.prop_filter("finite", |value| value.is_finite());
    let pose = (-1e6..=1e6, -1e6..=1e6, yaw_rad).prop_map(|(x_m, y_m, yaw_rad)| Pose { x_m, y_m, yaw_rad });
    (pose, vec(reading, 0..=16), any::<bool>()).prop_map(|(pose, readings, after_gap)| SonarScan::new(pose, &readings, after_gap))
}

/// Tiles that a log takes for valid.
pub(crate) fn tile() -> impl Strategy<Value = MapTile> {
    let place = (-100_000..100_000, -100_000..100_000, 0..=1u32, any::<u32>(), any::<u64>());
    (place, 0.005..=1.0, vec(-100f32..=100.0, TILE_CELLS)).prop_map(|((column, row, layer, tiles_in_layer, scan_seq), cell_m, cells)| {
        let mut tile = MapTile { cell_m, scan_seq, column, row, layer, tiles_in_layer, ..MapTile::default() };
        tile.log_odds.copy_from_slice(&cells);
        tile
    })
}
