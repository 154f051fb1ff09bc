//! Everything random: one stream of numbers for each ping and each step, so that the world can be taken up at any place and
//! gives the same numbers for any walker.

use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;

/// Streams of the odometry's steps; those of the pings count from 0.
const STEPS: u64 = 1 << 63;

/// Streams of the grain of the camera's pictures.
const GRAIN: u64 = 1 << 61;

/// What chance decides about one ping.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct PingChance {
    /// In [0, 1): below the share of missed echoes, the echo is missed.
    pub(crate) missed: f64,
    /// In [0, 1), for mirrored echoes.
    pub(crate) mirrored: f64,
    /// In [0, 1), for crosstalk.
    pub(crate) crosstalk: f64,
    /// In [0, 1): the share of the acoustics limit at which crosstalk comes in.
    pub(crate) crosstalk_range: f64,
    /// Normally distributed with variance 1.
    pub(crate) noise: f64,
}

impl PingChance {
    /// Of a ping, by its number.
    pub(crate) fn of(seed: u64, ping: u64) -> Self {
        let mut stream = stream(seed, ping);
        Self {
            missed: stream.random(),
            mirrored: stream.random(),
            crosstalk: stream.random(),
            crosstalk_range: stream.random(),
            noise: normal(&mut stream),
        }
    }
}

/// The numbers of an odometry step.
pub(crate) fn of_step(seed: u64, step: u64) -> ChaCha8Rng {
    stream(seed, STEPS | step)
}

/// The numbers of the grain of a camera's picture.
pub(crate) fn of_grain(seed: u64, frame: u64) -> ChaCha8Rng {
    stream(seed, GRAIN | frame)
}

fn stream(seed: u64, number: u64) -> ChaCha8Rng {
    let mut stream = ChaCha8Rng::seed_from_u64(seed);
    stream.set_stream(number);
    stream
}

/// A number of the normal distribution with mean 0 and variance 1 (Box and Muller).
pub(crate) fn normal(chance: &mut ChaCha8Rng) -> f64 {
    let (radius, turn): (f64, f64) = (chance.random(), chance.random());
    (-2.0 * (1.0 - radius).ln()).sqrt() * (std::f64::consts::TAU * turn).cos()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn normal_numbers_have_mean_0_and_variance_1() {
        let mut chance = of_step(7, 0);
        let numbers: Vec<f64> = (0..20_000).map(|_| normal(&mut chance)).collect();
        let mean = numbers.iter().sum::<f64>() / 20_000.0;
        let variance = numbers.iter().map(|number| number * number).sum::<f64>() / 20_000.0;
        assert!(mean.abs() < 0.03 && (variance - 1.0).abs() < 0.05, "{mean} {variance}");
    }

    #[test]
    fn each_ping_and_each_seed_has_its_own_numbers() {
        let first = PingChance::of(1, 1);
        assert_eq!(first, PingChance::of(1, 1));
        assert_ne!(first, PingChance::of(1, 2));
        assert_ne!(first, PingChance::of(2, 1));
    }
}
