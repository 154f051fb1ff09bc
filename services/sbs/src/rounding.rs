//! Rounding that the vector units do.

/// 1.5 × 2²³: a small number added to it is rounded to a whole one, which stands in the low bits. The vector units do this for
/// four and more at a time; a conversion to an integer they do one by one.
const ROUNDING: f32 = 12_582_912.0;

/// The whole number below x (or x − 1 for a whole x), at most one below `last`.
#[inline(always)]
pub(crate) fn below(x: f32, last: f32) -> f32 {
    let rounded = ((x - 0.5) + ROUNDING) - ROUNDING;
    let rounded = if rounded > 0.0 { rounded } else { 0.0 };
    if rounded < last - 1.0 { rounded } else { last - 1.0 }
}

#[inline(always)]
pub(crate) fn whole_number(x: f32) -> i32 {
    (x + ROUNDING).to_bits() as i32 - ROUNDING.to_bits() as i32
}

/// x within 0 and `last`; 0 for NaN.
#[inline(always)]
pub(crate) fn limited(x: f32, last: f32) -> f32 {
    let x = if x > 0.0 { x } else { 0.0 };
    if x < last { x } else { last }
}
