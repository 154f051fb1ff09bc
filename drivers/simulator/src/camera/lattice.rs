//! Numbers by place: the same place always gives the same number, on every machine.
//!
//! Integers are mixed, and single-precision numbers only added, multiplied and compared: no function of a mathematical library
//! takes part.

/// A number that depends on all of these as if by chance.
pub(super) fn mixed(seed: u32, x: i32, y: i32) -> u32 {
    let mut number = seed ^ (x as u32).wrapping_mul(0x9E37_79B1) ^ (y as u32).wrapping_mul(0x85EB_CA77).rotate_left(13);
    number = (number ^ (number >> 16)).wrapping_mul(0x7FEB_352D);
    number = (number ^ (number >> 15)).wrapping_mul(0x846C_A68B);
    number ^ (number >> 16)
}

/// The same in [0, 1).
pub(super) fn share(seed: u32, x: i32, y: i32) -> f32 {
    (mixed(seed, x, y) >> 8) as f32 / 16_777_216.0
}

/// The whole number below, and the rest in [0, 1).
pub(super) fn floored(x: f32) -> (i32, f32) {
    let towards_zero = x as i32;
    let below = towards_zero.wrapping_sub(i32::from(x < towards_zero as f32));
    (below, x - below as f32)
}

/// From 0 at 0 to 1 at 1 without corners.
pub(super) fn eased(share: f32) -> f32 {
    share * share * (3.0 - 2.0 * share)
}

/// A number in [−1, 1] that goes smoothly with x; it is new after every whole step.
pub(super) fn wave(seed: u32, x: f32) -> f32 {
    let (step, rest) = floored(x);
    let (from, to) = (share(seed, step, 0), share(seed, step.wrapping_add(1), 0));
    2.0 * (from + (to - from) * eased(rest)) - 1.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn floored_is_the_floor() {
        for x in [-2.5_f32, -2.0, -0.25, 0.0, 0.75, 3.0, 99.5] {
            let (below, rest) = floored(x);
            assert_eq!((below as f32, rest), (x.floor(), x - x.floor()), "{x}");
        }
    }

    #[test]
    fn shares_are_even_and_waves_have_no_jumps() {
        let mean = (0..4096).map(|k| share(7, k % 64, k / 64)).sum::<f32>() / 4096.0;
        assert!((mean - 0.5).abs() < 0.02, "{mean}");
        let steps = (0..5000).map(|k| (wave(3, k as f32 * 0.01 - 20.0) - wave(3, (k + 1) as f32 * 0.01 - 20.0)).abs());
        assert!(steps.fold(0.0, f32::max) < 0.04);
    }
}
