//! The sensor model (eq. 2) with its two limits, as log-odds.

use crate::numeric::{Lanes, SMALL, all, exp, ln, small_atanh};
use crate::parameters::SensorParameters;
use crate::tuning::Tuned;

/// A fade's steepness: δ(x; m) = ½ (1 − tanh 2 (x − m)) = 1 / (1 + exp 4 (x − m)).
const FADE_PER_M: f64 = 4.0;

/// Where the parts of eq. 2 begin and end, m: free before `a`, rising from `a` to `b`, occupied from `b` to `c`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Extent {
    pub(crate) b: f64,
    pub(crate) c: f64,
    /// Peak probability at this range; 0.5 without an echo.
    k_o: f64,
}

impl Extent {
    /// Of an echo from `range_m`.
    pub(crate) fn of_echo(parameters: &SensorParameters, range_m: f64) -> Self {
        let k_o = match parameters.fades {
            // A little above one half, so that the reading's place keeps an extent.
            Some(fades) => 0.501 + (parameters.k_o - 0.501) * fade(range_m, fades.occupied_m),
            None => parameters.k_o,
        };
        let half = parameters.sigma_r_m * (2.0 * k_o).ln().sqrt();
        Self { b: range_m - half, c: range_m + half, k_o }
    }

    /// Of no echo up to `range_m`: it has no occupied part, and beyond a distance silence is as likely a wall that reflects away.
    pub(crate) fn of_silence(parameters: &SensorParameters, range_m: f64) -> Self {
        let end = (range_m - parameters.sigma_r_m).min(parameters.no_echo_free_m);
        Self { b: end, c: end, k_o: 0.5 }
    }

    /// The same reading without its occupied part.
    pub(crate) fn without_surface(self) -> Self {
        Self { c: self.b, ..self }
    }
}

fn fade(x_m: f64, half_at_m: f64) -> f64 {
    1.0 / (1.0 + (FADE_PER_M * (x_m - half_at_m)).exp())
}

/// Eq. 2 for one reading, ready to be asked for many cells: each number stands in every lane.
#[derive(Debug, Clone, Copy)]
pub(crate) struct SensorModel {
    range: Lanes,
    pub(crate) a: Lanes,
    b: Lanes,
    pub(crate) c: Lanes,
    k_o: Lanes,
    inverse_sigma_r2: Lanes,
    theta_bar: Lanes,
    inverse_sigma_theta2: Lanes,
    /// ½ − k_e.
    emptiness: Lanes,
    /// Whether the log-odds of emptiness are small enough for their series.
    is_gentle: bool,
    /// Where emptiness has lost half its weight; `None` when it never does.
    free_fade: Option<Lanes>,
}

impl SensorModel {
    pub(crate) fn new(parameters: &SensorParameters, range_m: f64, extent: Extent, tuned: Tuned) -> Self {
        let emptiness_at_b = (0.5 - tuned.k_e) * parameters.fades.map_or(1.0, |fades| fade(extent.b, fades.free_m));
        // Continuity at a: k_o G(a) = k_e. The fade changes little over the few centimetres from a to b and is taken at b.
        let rise = parameters.sigma_r_m * (extent.k_o / (0.5 - emptiness_at_b)).ln().max(0.0).sqrt();
        let a = if extent.k_o > 0.5 { (range_m - rise).min(extent.b) } else { extent.b };
        let in_every_lane = |number: f64| all(number as f32);
        Self {
            range: in_every_lane(range_m),
            a: in_every_lane(a),
            b: in_every_lane(extent.b),
            c: in_every_lane(extent.c),
            k_o: in_every_lane(extent.k_o),
            inverse_sigma_r2: in_every_lane(parameters.sigma_r_m.powi(-2)),
            theta_bar: in_every_lane(tuned.theta_bar_rad),
            inverse_sigma_theta2: in_every_lane(tuned.sigma_theta_rad.powi(-2)),
            emptiness: in_every_lane(0.5 - tuned.k_e),
            is_gentle: 1.0 - 2.0 * tuned.k_e < f64::from(SMALL),
            free_fade: parameters.fades.map(|fades| in_every_lane(fades.free_m)),
        }
    }

    /// ln (p / (1 − p)) of eq. 2's p for cells at distances `z` m before the rise (z < a) and azimuths `theta` rad.
    #[inline(always)]
    pub(crate) fn free_log_odds(&self, z: Lanes, theta: Lanes) -> Lanes {
        if !self.may_be_freed(z, theta).any() {
            return all(0.0);
        }
        let q = self.emptiness_at(z) * self.angular(theta);
        // 2 q − 1: where it is not above 0, eq. 2 says nothing. ln (q / (1 − q)) is twice its artanh.
        let t = (q + q - all(1.0)).fast_max(all(0.0));
        if self.is_gentle { all(-2.0) * small_atanh(t) } else { -log_odds_above_half(q) }
    }

    /// Whether eq. 2 may say anything about cells before the rise. Far ahead it says something close to the axis only: half of a
    /// long beam need not be looked at further.
    ///
    /// (1 − k_e(z)) A > ½ means that (θ − θ̄)² / σ_θ² < ln (1 + (1 − 2 k_e) δ), which is at most (1 − 2 k_e) δ; and
    /// 1 / δ = 1 + exp x is at least 2 + x + x² / 2 + x³ / 6.
    #[inline(always)]
    fn may_be_freed(&self, z: Lanes, theta: Lanes) -> Lanes {
        let off = theta - self.theta_bar;
        let spread = off * off * self.inverse_sigma_theta2;
        let most = self.emptiness + self.emptiness;
        match self.free_fade {
            Some(half_at) => {
                let x = all(FADE_PER_M as f32) * (z - half_at);
                let least = all(2.0) + x * (all(1.0) + x * (all(1.0 / 2.0) + x * all(1.0 / 6.0)));
                (spread * least).simd_lt(most)
            }
            None => spread.simd_lt(most),
        }
    }

    /// ln (p / (1 − p)) of eq. 2's p for cells at distances `z` m and azimuths `theta` rad; 0 where nothing is said.
    #[inline(always)]
    pub(crate) fn log_odds(&self, z: Lanes, theta: Lanes) -> Lanes {
        let off = self.range - z;
        let surface = self.k_o * exp(-(off * off) * self.inverse_sigma_r2);
        let (free, rising, occupied) = (z.simd_lt(self.a), z.simd_lt(self.b), z.simd_lt(self.c));
        let beyond_a = rising.select(all(1.0) - surface, occupied & surface);
        let radial = free.select(self.emptiness_at(z), beyond_a);
        let said = log_odds_above_half(radial * self.angular(theta));
        rising.select(-said, said)
    }

    /// 1 − k_e(z).
    #[inline(always)]
    fn emptiness_at(&self, z: Lanes) -> Lanes {
        match self.free_fade {
            Some(half_at) => all(0.5) + self.emptiness / (all(1.0) + exp(all(FADE_PER_M as f32) * (z - half_at))),
            None => all(0.5) + self.emptiness,
        }
    }

    /// A(θ).
    #[inline(always)]
    fn angular(&self, theta: Lanes) -> Lanes {
        let off = theta - self.theta_bar;
        exp(-(off * off) * self.inverse_sigma_theta2)
    }
}

/// ln (q / (1 − q)) where q > ½, else 0: below one half eq. 2 says nothing.
#[inline(always)]
fn log_odds_above_half(q: Lanes) -> Lanes {
    let q = q.fast_max(all(0.5));
    ln(q / (all(1.0) - q))
}
