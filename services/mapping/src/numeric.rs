//! Elementary functions of a few numbers at once, in single precision.
//!
//! They have no branches and use nothing but the basic operations, so they are the same on every machine, and a map's digest
//! with them. Polynomials after Cephes (S. Moshier, single precision); the error of `exp` is relative, the others' absolute, and
//! below 2·10⁻⁷ (for `ln` of large numbers relative, too).

use bytemuck::cast;
use wide::{f32x4, i32x4};

/// Neighbouring cells of a row, worked on together.
pub(crate) type Lanes = f32x4;
/// How many they are.
pub(crate) const LANES: usize = 4;

/// The same number in every lane.
#[inline(always)]
pub(crate) fn all(number: f32) -> Lanes {
    Lanes::splat(number)
}

/// eˣ for x from −80 to 80; beyond, as at the ends: products with what comes out stay normal numbers, others are slow.
#[inline(always)]
pub(crate) fn exp(x: Lanes) -> Lanes {
    // Adding 1.5 · 2²³ rounds to a whole number, which then stands in the low bits.
    let round = all(12_582_912.0);
    let x = x.fast_max(all(-80.0)).fast_min(all(80.0));
    let shifted = x * all(std::f32::consts::LOG2_E) + round;
    let n = shifted - round;
    let r = x - n * all(0.693_359_4) + n * all(2.121_944_4e-4);
    let r2 = r * r;
    let low = all(4.166_579_6e-2) * r + all(1.666_666_5e-1);
    let high = all(1.987_569_1e-4) * r + all(1.398_2e-3);
    let p = (high * r + all(8.333_452e-3)) * r2 + low;
    let p = p * r + all(0.5);
    let scale: Lanes = cast((cast::<Lanes, i32x4>(shifted) + i32x4::splat(127)) << 23);
    (p * r2 + (r + all(1.0))) * scale
}

/// ln x for normal x above 0; a large finite number for +∞.
#[inline(always)]
pub(crate) fn ln(x: Lanes) -> Lanes {
    // √½: the mantissa is taken from [√½, √2), where the polynomial holds.
    const SQRT_HALF_BITS: i32 = 0x3f35_04f3;
    let bits: i32x4 = cast(x);
    let exponent = (bits - i32x4::splat(SQRT_HALF_BITS)) >> 23;
    let f = cast::<i32x4, Lanes>(bits - (exponent << 23)) - all(1.0);
    let p = all(7.037_683_6e-2);
    let p = p * f - all(1.151_461e-1);
    let p = p * f + all(1.167_699_87e-1);
    let p = p * f - all(1.242_014_1e-1);
    let p = p * f + all(1.424_932_3e-1);
    let p = p * f - all(1.666_805_8e-1);
    let p = p * f + all(2.000_071_5e-1);
    let p = p * f - all(2.499_999_4e-1);
    let p = p * f + all(3.333_333e-1);
    let e = Lanes::from_i32x4(exponent);
    let f2 = f * f;
    let small = p * f * f2 - e * all(2.121_944_4e-4) - all(0.5) * f2;
    f + small + e * all(0.693_359_4)
}

/// The greatest number that [`small_atanh`] takes.
pub(crate) const SMALL: f32 = 0.34;

/// artanh t for |t| ≤ [`SMALL`]: the first terms of its series, the next is below 10⁻⁷.
#[inline(always)]
pub(crate) fn small_atanh(t: Lanes) -> Lanes {
    let t2 = t * t;
    let t4 = t2 * t2;
    let low = all(1.0 / 5.0) * t2 + all(1.0 / 3.0);
    let high = all(1.0 / 11.0) * t4 + (all(1.0 / 9.0) * t2 + all(1.0 / 7.0));
    let p = high * t4 + low;
    p * (t2 * t) + t
}

/// Angle of (x, y) from the x axis, rad, for x above 0 and |y| ≤ 2.4 x.
#[inline(always)]
pub(crate) fn azimuth(x: Lanes, y: Lanes) -> Lanes {
    let sign = y & all(-0.0);
    let side = y ^ sign;
    // Above 22.5° measured from the diagonal.
    let steep = side.simd_gt(x * all(0.414_213_56));
    let t = (side - (steep & x)) / (x + (steep & side));
    let t2 = t * t;
    let p = all(8.053_744_5e-2);
    let p = p * t2 - all(1.387_768_6e-1);
    let p = p * t2 + all(1.997_771e-1);
    let p = p * t2 - all(3.333_295e-1);
    let angle = p * t2 * t + t + (steep & all(std::f32::consts::FRAC_PI_4));
    angle ^ sign
}

#[cfg(test)]
mod tests {
    use super::*;

    fn first(lanes: Lanes) -> f64 {
        let [one, two, three, four] = lanes.to_array();
        assert!(one.to_bits() == two.to_bits() && one.to_bits() == three.to_bits() && one.to_bits() == four.to_bits());
        f64::from(one)
    }

    #[test]
    fn exp_is_close_everywhere() {
        for i in -800_000..=800_000 {
            let x = i as f32 * 1e-4;
            let found = first(exp(all(x)));
            assert!((found / f64::from(x).exp() - 1.0).abs() < 2e-7, "exp({x}) = {found}");
        }
        assert!(first(exp(all(f32::NEG_INFINITY))) < 1e-34 && first(exp(all(f32::INFINITY))) > 1e34);
    }

    #[test]
    fn ln_is_close_everywhere() {
        for i in 1..2_000_000 {
            let x = i as f32 * 1e-3 * (1.0 + i as f32 * 1e-4);
            let expected = f64::from(x).ln();
            let found = first(ln(all(x)));
            assert!((found - expected).abs() < 2e-7 * expected.abs().max(1.0), "ln({x}) = {found}");
        }
        let of_infinity = first(ln(all(f32::INFINITY)));
        assert!(of_infinity > 88.0 && of_infinity.is_finite());
    }

    #[test]
    fn small_atanh_is_close() {
        for i in -340_000..=340_000 {
            let t = i as f32 * 1e-6;
            let found = first(small_atanh(all(t)));
            assert!((found - f64::from(t).atanh()).abs() < 2e-7, "artanh({t}) = {found}");
        }
    }

    #[test]
    fn azimuth_is_close_within_67_degrees() {
        for i in -670_000..=670_000 {
            let angle = f64::from(i) * 1e-4;
            let (y, x) = angle.to_radians().sin_cos();
            let (x, y) = ((2.5 * x) as f32, (2.5 * y) as f32);
            let found = first(azimuth(all(x), all(y)));
            assert!((found - f64::from(y).atan2(f64::from(x))).abs() < 2e-7, "azimuth at {angle}° = {found}");
        }
    }
}
