//! Masks: median, dilation, erosion. A mask holds 0 and 255.

use crate::model::SET;
use crate::plane::Plane;
use crate::vectorised::vectorised;

/// The 3 × 3 median: set where at least five of nine are.
pub(crate) fn median(mask: &Plane<u8>) -> Plane<u8> {
    neighbourhood(mask, 5)
}

/// The 3 × 3 dilation.
pub(crate) fn dilated(mask: &Plane<u8>) -> Plane<u8> {
    neighbourhood(mask, 1)
}

/// The 3 × 3 erosion.
pub(crate) fn eroded(mask: &Plane<u8>) -> Plane<u8> {
    neighbourhood(mask, 9)
}

/// Dilation and erosion: fills gaps up to two pixels wide.
pub(crate) fn closed(mask: &Plane<u8>) -> Plane<u8> {
    eroded(&dilated(mask))
}

/// The mask in a picture `factor` times smaller: set where any of its pixels is.
pub(crate) fn reduced(mask: &Plane<u8>, factor: usize) -> Plane<u8> {
    if factor == 1 {
        return mask.clone();
    }
    let (width, height) = (mask.width() / factor, mask.height() / factor);
    let mut out = Plane::filled(width, height, 0_u8);
    for v in 0..height * factor {
        for (o, pixels) in out.row_mut(v / factor).iter_mut().zip(mask.row(v).chunks_exact(factor)) {
            *o |= pixels.iter().fold(0, |a, &b| a | b);
        }
    }
    out
}

vectorised! {
    /// Set where at least `least` of the 3 × 3 pixels around are; border pixels repeated.
    fn neighbourhood(mask: &Plane<u8>, least: u8) -> Plane<u8> {
        let (width, height) = (mask.width(), mask.height());
        let mut out = Plane::filled(width, height, 0);
        let mut column = vec![0_u8; width + 2];
        for v in 0..height {
            let above = mask.row(v.saturating_sub(1));
            let here = mask.row(v);
            let below = mask.row((v + 1).min(height - 1));
            for (((c, &a), &h), &b) in column[1..].iter_mut().zip(above).zip(here).zip(below) {
                *c = (a & 1) + (h & 1) + (b & 1);
            }
            column[0] = column[1];
            column[width + 1] = column[width];
            let (left, middle, right) = (&column[..width], &column[1..=width], &column[2..]);
            for (((o, &l), &m), &r) in out.row_mut(v).iter_mut().zip(left).zip(middle).zip(right) {
                *o = if l + m + r >= least { SET } else { 0 };
            }
        }
        out
    }
}
