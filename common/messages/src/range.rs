//! The values that a payload accepts, found by trying.

use std::collections::BTreeMap;

use crate::{FrameLayout, Payload, PixelFormat, Shape};

/// A number within a payload: where it is and what it is.
#[derive(Clone, Copy)]
struct Leaf {
    offset: usize,
    shape: Shape,
}

/// What [`Payload::validate`] expects of each number of a payload, by the offset of the number; of an array by that of its first
/// entry. A number of which any value is accepted is left out.
///
/// Each number in turn is given values that no range contains. What the payload then expects is the range: it cannot differ from the
/// check.
pub(crate) fn ranges<T: Payload>() -> BTreeMap<usize, &'static str> {
    let mut leaves = Vec::new();
    let mut valid = T::default();
    collect(&T::SHAPE, 0, bytemuck::bytes_of_mut(&mut valid), &mut leaves);
    repair(&mut valid, &leaves);
    leaves.iter().filter_map(|leaf| Some((leaf.offset, expected(&valid, leaf)?))).collect()
}

/// What [`FrameLayout::validate`] expects of each field, in their order.
pub(crate) fn frame_layout_ranges() -> [Option<&'static str>; 4] {
    let valid = FrameLayout::packed(320, 240, PixelFormat::Grey);
    let wrong = u32::MAX;
    [
        FrameLayout { width: wrong, ..valid },
        FrameLayout { height: wrong, ..valid },
        FrameLayout { stride: wrong, ..valid },
        FrameLayout { format: wrong, ..valid },
    ]
    .map(|layout| layout.validate(layout.bytes()).err().map(|invalid| invalid.expected))
}

/// Lists the numbers of a shape that lies at this offset, and makes every list one entry long, so that the entry is checked.
fn collect(shape: &Shape, offset: usize, bytes: &mut [u8], leaves: &mut Vec<Leaf>) {
    match shape {
        Shape::Text(_) => {}
        Shape::Array(of, _) => collect(of, offset, bytes, leaves),
        Shape::Struct { fields, .. } => {
            for field in *fields {
                if let Some(count) = field.count {
                    set(bytes, offset + count, &1_u32.to_le_bytes());
                }
                collect(&field.shape, offset + field.offset, bytes, leaves);
            }
        }
        _ => leaves.push(Leaf { offset, shape: *shape }),
    }
}

/// Sets numbers that may not be 0 to 1.
fn repair<T: Payload>(payload: &mut T, leaves: &[Leaf]) {
    for leaf in leaves {
        let Err(before) = payload.validate() else { return };
        let mut changed = *payload;
        let one: &[u8] = match leaf.shape {
            Shape::F32 => &1_f32.to_le_bytes(),
            Shape::F64 => &1_f64.to_le_bytes(),
            _ => &[1],
        };
        set(bytemuck::bytes_of_mut(&mut changed), leaf.offset, one);
        if changed.validate().err().is_none_or(|after| after.field != before.field) {
            *payload = changed;
        }
    }
}

/// What a payload expects of one of its numbers.
fn expected<T: Payload>(valid: &T, leaf: &Leaf) -> Option<&'static str> {
    let beyond: Vec<Vec<u8>> = match leaf.shape {
        Shape::F32 => [f32::MAX, f32::MIN, f32::NAN].map(|value| value.to_le_bytes().to_vec()).into(),
        Shape::F64 => [f64::MAX, f64::MIN, f64::NAN].map(|value| value.to_le_bytes().to_vec()).into(),
        Shape::I32 => [i32::MAX, i32::MIN].map(|value| value.to_le_bytes().to_vec()).into(),
        _ => vec![vec![0xff; leaf.shape.size()]],
    };
    beyond.iter().find_map(|bytes| {
        let mut changed = *valid;
        set(bytemuck::bytes_of_mut(&mut changed), leaf.offset, bytes);
        changed.validate().err().map(|invalid| invalid.expected)
    })
}

fn set(bytes: &mut [u8], offset: usize, value: &[u8]) {
    bytes[offset..offset + value.len()].copy_from_slice(value);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{DeploymentStatus, LogLine, MapTile, Pictures, ServiceVisitor, SonarScan, visit_services};
    use core::convert::Infallible;
    use core::mem::offset_of;

    #[test]
    fn the_ranges_are_those_of_the_checks() {
        let scan = ranges::<SonarScan>();
        let range_m = offset_of!(SonarScan, readings) + offset_of!(crate::SonarReading, range_m);
        assert_eq!((scan[&range_m], scan[&offset_of!(SonarScan, count)]), ("0 to 10 m", "at most 16"));
        assert_eq!(ranges::<LogLine>()[&offset_of!(LogLine, level)], "1 to 4");
        assert_eq!(ranges::<MapTile>()[&offset_of!(MapTile, cell_m)], "0.005 to 1 m");
        assert!(!ranges::<DeploymentStatus>().contains_key(&offset_of!(DeploymentStatus, uptime_ms)));
    }

    struct Floats;

    impl ServiceVisitor for Floats {
        type Error = Infallible;

        fn message<T: Payload>(&mut self) -> Result<(), Infallible> {
            let (mut leaves, ranges) = (Vec::new(), ranges::<T>());
            collect(&T::SHAPE, 0, bytemuck::bytes_of_mut(&mut T::default()), &mut leaves);
            for leaf in leaves.iter().filter(|leaf| matches!(leaf.shape, Shape::F32 | Shape::F64)) {
                assert!(ranges.contains_key(&leaf.offset), "{}: the number at {} may be anything", T::SERVICE.name, leaf.offset);
            }
            Ok(())
        }

        fn pictures<P: Pictures>(&mut self) -> Result<(), Infallible> {
            Ok(())
        }
    }

    #[test]
    fn no_payload_accepts_a_float_that_is_not_finite() {
        let Ok(()) = visit_services(&mut Floats);
    }
}
