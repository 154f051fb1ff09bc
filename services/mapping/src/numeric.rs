//! Elementary functions in single precision.
//!
//! They have no branches, so that the compiler turns the loops over a few neighbouring cells into vector instructions, and
//! they are the same on every machine, so that a map's digest is. Polynomials after Cephes (S. Moshier, single precision);
//! relative errors are below 2·10⁻⁷ for `exp`, absolute ones below that for the others.

/// eˣ for x from −87 to 87, and e⁻⁸⁷ below.
#[inline(always)]
pub(crate) fn exp(x: f32) -> f32 {
    // Adding 1.5 · 2²³ rounds to a whole number, which then stands in the low bits.
    const ROUND: f32 = 12_582_912.0;
    let x = if x < -87.0 { -87.0 } else { x };
    let shifted = x * std::f32::consts::LOG2_E + ROUND;
    let n = shifted - ROUND;
    let r = x - n * 0.693_359_4 + n * 2.121_944_4e-4;
    let p = 1.987_569_1e-4;
    let p = p * r + 1.398_2e-3;
    let p = p * r + 8.333_452e-3;
    let p = p * r + 4.166_579_6e-2;
    let p = p * r + 1.666_666_5e-1;
    let p = p * r + 0.5;
    let scale = f32::from_bits(shifted.to_bits().wrapping_add(127) << 23);
    (p * r * r + r + 1.0) * scale
}

/// ln x for normal x above 0; a large finite number for +∞.
#[inline(always)]
pub(crate) fn ln(x: f32) -> f32 {
    // √½: the mantissa is taken from [√½, √2), where the polynomial holds.
    const SQRT_HALF_BITS: u32 = 0x3f35_04f3;
    let bits = x.to_bits();
    let exponent = (bits.wrapping_sub(SQRT_HALF_BITS) as i32) >> 23;
    let f = f32::from_bits(bits.wrapping_sub((exponent << 23) as u32)) - 1.0;
    let p = 7.037_683_6e-2;
    let p = p * f - 1.151_461e-1;
    let p = p * f + 1.167_699_87e-1;
    let p = p * f - 1.242_014_1e-1;
    let p = p * f + 1.424_932_3e-1;
    let p = p * f - 1.666_805_8e-1;
    let p = p * f + 2.000_071_5e-1;
    let p = p * f - 2.499_999_4e-1;
    let p = p * f + 3.333_333e-1;
    let e = exponent as f32;
    let f2 = f * f;
    let small = p * f * f2 - e * 2.121_944_4e-4 - 0.5 * f2;
    f + small + e * 0.693_359_4
}

/// Angle of (x, y) from the x axis, rad, for x above 0 and |y| ≤ 2.4 x.
#[inline(always)]
pub(crate) fn azimuth(x: f32, y: f32) -> f32 {
    const TAN_22_5_DEG: f32 = 0.414_213_56;
    let side = y.abs();
    // Above 22.5° measured from the diagonal.
    let steep = side > TAN_22_5_DEG * x;
    let t = if steep { side - x } else { side } / if steep { side + x } else { x };
    let t2 = t * t;
    let p = 8.053_744_5e-2;
    let p = p * t2 - 1.387_768_6e-1;
    let p = p * t2 + 1.997_771e-1;
    let p = p * t2 - 3.333_295e-1;
    let angle = p * t2 * t + t + if steep { std::f32::consts::FRAC_PI_4 } else { 0.0 };
    angle.copysign(y)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exp_is_close_everywhere() {
        for i in -870_000..=100_000 {
            let x = i as f32 * 1e-4;
            let expected = f64::from(x).exp();
            assert!((f64::from(exp(x)) / expected - 1.0).abs() < 2e-7, "exp({x}) = {}", exp(x));
        }
        assert!(exp(-1e30) < 1e-37 && exp(f32::NEG_INFINITY) < 1e-37);
    }

    #[test]
    fn ln_is_close_everywhere() {
        for i in 1..2_000_000 {
            let x = i as f32 * 1e-3 * (1.0 + i as f32 * 1e-4);
            let expected = f64::from(x).ln();
            assert!((f64::from(ln(x)) - expected).abs() < 2e-7 * expected.abs().max(1.0), "ln({x}) = {}", ln(x));
        }
        assert!(ln(f32::INFINITY) > 88.0 && ln(f32::INFINITY).is_finite());
    }

    #[test]
    fn azimuth_is_close_within_67_degrees() {
        for i in -670_000..=670_000 {
            let angle = f64::from(i) * 1e-4;
            let (y, x) = angle.to_radians().sin_cos();
            let (x, y) = ((2.5 * x) as f32, (2.5 * y) as f32);
            let expected = f64::from(y).atan2(f64::from(x));
            assert!((f64::from(azimuth(x, y)) - expected).abs() < 2e-7, "azimuth at {angle}° = {}", azimuth(x, y));
        }
    }
}
