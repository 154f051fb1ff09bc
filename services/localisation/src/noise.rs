//! How much the ranges of this robot's sonars scatter.

use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

/// Width of a bin of the histogram, m.
const BIN_M: f64 = 0.001;
/// Bins; larger differences are steps in the scene and count as the last.
const BINS: usize = 256;
/// Before as many differences the estimate is the initial one.
const LEAST: u32 = 40;
/// Standard deviation of a Pioneer's ranges at middle distances, m: taken until enough was measured.
const INITIAL_M: f64 = 0.008;
/// No sonar is better than the first; beyond the second, gates would accept one wall's echoes for another's. m.
const LIMITS_M: [f64; 2] = [0.006, 0.06];
/// A Gaussian's standard deviation over the median of its absolute values.
const OVER_MEDIAN: f64 = 1.4826;
/// The differences r₁ − 2 r₂ + r₃ scatter by √6 of a range's deviation.
const OVER_RANGE: f64 = 2.449_489_742_783_178;

/// Histogram of second differences |r₁ − 2 r₂ + r₃| of consecutive echoes of one sonar while the robot drives: along a wall the
/// ranges are linear, so that the differences hold the noise alone.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, Schema)]
pub(crate) struct Noise {
    counts: Vec<u32>,
    total: u32,
}

impl Default for Noise {
    fn default() -> Self {
        Self { counts: vec![0; BINS], total: 0 }
    }
}

impl Noise {
    /// Three consecutive ranges, m.
    pub(crate) fn add(&mut self, [first, second, third]: [f64; 3]) {
        let bin = ((first - 2.0 * second + third).abs() / BIN_M) as usize;
        if let Some(count) = self.counts.get_mut(bin.min(BINS - 1)) {
            *count = count.saturating_add(1);
            self.total = self.total.saturating_add(1);
        }
    }

    /// Standard deviation of a range, m.
    pub(crate) fn deviation_m(&self) -> f64 {
        if self.total < LEAST {
            return INITIAL_M;
        }
        let mut below = 0;
        let median = self.counts.iter().position(|count| {
            below += u64::from(*count);
            below > u64::from(self.total / 2)
        });
        let median_m = (median.unwrap_or(BINS) as f64 + 0.5) * BIN_M;
        (OVER_MEDIAN * median_m / OVER_RANGE).clamp(LIMITS_M[0], LIMITS_M[1])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A sum of twelve uniform numbers is Gaussian enough for a median; they follow from a fixed seed.
    fn normal(state: &mut u64) -> f64 {
        let mut uniform = || {
            *state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (*state >> 11) as f64 / (1u64 << 53) as f64
        };
        (0..12).map(|_| uniform()).sum::<f64>() - 6.0
    }

    #[test]
    fn the_deviation_of_noisy_ranges_is_found() {
        for deviation_m in [0.01, 0.02, 0.05] {
            let (mut noise, mut state) = (Noise::default(), 1);
            let ranges: Vec<f64> = (0..40_000).map(|k| 1.0 + 0.01 * f64::from(k) + deviation_m * normal(&mut state)).collect();
            ranges.windows(3).for_each(|three| noise.add([three[0], three[1], three[2]]));
            assert!((noise.deviation_m() / deviation_m - 1.0).abs() < 0.06, "{} for {deviation_m}", noise.deviation_m());
        }
    }

    #[test]
    fn few_ranges_leave_the_initial_deviation() {
        let mut noise = Noise::default();
        (0..39).for_each(|_| noise.add([1.0, 1.2, 1.0]));
        assert_eq!(noise.deviation_m(), INITIAL_M);
        noise.add([1.0, f64::INFINITY, 1.0]);
        assert_eq!(noise.deviation_m(), LIMITS_M[1]);
    }
}
