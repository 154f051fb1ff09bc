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
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn the_deviation_of_noisy_ranges_is_found(deviation_m in 0.01..0.05f64, seeds in proptest::collection::vec(0.0..1.0f64, 3000)) {
            // Sums of twelve uniform numbers are Gaussian enough for a median.
            let normal: Vec<f64> = seeds.chunks(12).map(|chunk| chunk.iter().sum::<f64>() - 6.0).collect();
            let mut noise = Noise::default();
            let at = |k: usize| 1.0 + 0.01 * k as f64 + deviation_m * normal[k];
            (2..normal.len()).for_each(|k| noise.add([at(k - 2), at(k - 1), at(k)]));
            prop_assert!((noise.deviation_m() / deviation_m - 1.0).abs() < 0.35, "{} for {deviation_m}", noise.deviation_m());
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
