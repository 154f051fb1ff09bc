//! The pixel process as a three-class mixture, learned by EM (eq. 4).
//!
//! `p(z) = ω_F / R + ω_B N(z; μ_B, σ_B) + ω_S N(z; μ_S, σ_S)` with R = 256 and μ_S < μ_B: foreground of unknown distribution,
//! background, and background in shadow. N is the usual density (the scan's square root over σ is a misprint).

use crate::order;

/// R of eq. 4: the number of grey levels.
pub const GREY_LEVELS: f64 = 256.0;

/// A Gaussian of the mixture.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Gaussian {
    /// Mean, grey levels.
    pub mean: f64,
    /// Standard deviation, grey levels.
    pub sigma: f64,
}

/// Weights ω of the three classes; they sum to 1.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Weights {
    /// Foreground, uniform.
    pub foreground: f64,
    /// Background.
    pub background: f64,
    /// Background in shadow.
    pub shadow: f64,
}

/// The parameters of eq. 4.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Mixture {
    /// B.
    pub background: Gaussian,
    /// S; its mean lies below B's.
    pub shadow: Gaussian,
    /// ω_F, ω_B, ω_S.
    pub weights: Weights,
}

/// What EM may and may not do.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EmRule {
    /// Smallest σ of a Gaussian, grey levels; the constrained maximum is σ = max(σ̂, σ_min).
    pub sigma_min: f64,
    /// Smallest weight of a class.
    pub weight_min: f64,
    /// Start of the shadow: μ_S = ratio × μ_B.
    pub shadow_ratio: f64,
    /// Largest σ_B to start from; an uncapped MAD fails when shadow covers half the samples.
    pub start_sigma_max: f64,
    /// Done when the log-likelihood grows by less than this share of itself.
    pub tolerance: f64,
    /// Most evaluations of the log-likelihood.
    pub iterations_max: usize,
    /// A class that explains fewer samples than this keeps its Gaussian.
    pub samples_min: f64,
}

impl Default for EmRule {
    fn default() -> Self {
        Self {
            sigma_min: 1.0,
            weight_min: 1e-3,
            shadow_ratio: 0.7,
            start_sigma_max: 8.0,
            tolerance: 1e-9,
            iterations_max: 200,
            samples_min: 1.0,
        }
    }
}

/// What EM found.
#[derive(Debug, Clone, PartialEq)]
pub struct Fit {
    /// The parameters after the last step.
    pub mixture: Mixture,
    /// The log-likelihood before each step; it never falls.
    pub log_likelihood: Vec<f64>,
}

impl Fit {
    /// The final log-likelihood.
    #[must_use]
    pub fn final_log_likelihood(&self) -> f64 {
        self.log_likelihood.last().copied().unwrap_or(f64::NEG_INFINITY)
    }
}

impl Gaussian {
    fn density(self, z: f64) -> f64 {
        let t = (z - self.mean) / self.sigma;
        (-0.5 * t * t).exp() / (self.sigma * (2.0 * std::f64::consts::PI).sqrt())
    }
}

impl Mixture {
    /// Where EM starts for a background mean: σ_B the scaled median absolute deviation from it, μ_S at the shadow ratio, σ_S twice σ_B.
    #[must_use]
    pub fn start(samples: &[f64], mean: f64, rule: &EmRule) -> Self {
        // 1.4826 turns the median absolute deviation of a Gaussian into its σ.
        let deviations: Vec<f64> = samples.iter().map(|z| (z - mean).abs()).collect();
        let mad = order::median(&deviations).unwrap_or(0.0);
        let sigma = (1.4826 * mad).clamp(rule.sigma_min, rule.start_sigma_max.max(rule.sigma_min));
        Self {
            background: Gaussian { mean, sigma },
            shadow: Gaussian { mean: rule.shadow_ratio * mean, sigma: 2.0 * sigma },
            weights: Weights { foreground: 0.05, background: 0.80, shadow: 0.15 },
        }
    }

    /// ω-weighted densities of F, B and S at a value.
    #[must_use]
    pub fn classes(&self, z: f64) -> [f64; 3] {
        [
            self.weights.foreground / GREY_LEVELS,
            self.weights.background * self.background.density(z),
            self.weights.shadow * self.shadow.density(z),
        ]
    }

    fn log_likelihood(&self, samples: &[f64]) -> f64 {
        samples.iter().map(|&z| self.classes(z).iter().sum::<f64>().ln()).sum()
    }
}

/// Learns eq. 4 from the values of one pixel (grey levels, 0 to 255).
///
/// EM is started with μ_B at the median and again at the 75th percentile, where the background lies when shadow covers half of
/// the time; the better final likelihood is kept. `None` without samples or with one that is no number.
#[must_use]
pub fn learn(samples: &[f64], rule: &EmRule) -> Option<Fit> {
    if samples.is_empty() || samples.iter().any(|z| !z.is_finite()) {
        return None;
    }
    let by_median = run(samples, Mixture::start(samples, order::median(samples)?, rule), rule);
    let by_upper = run(samples, Mixture::start(samples, order::quantile(samples, 0.75)?, rule), rule);
    let (at_median, at_upper) = (by_median.final_log_likelihood(), by_upper.final_log_likelihood());
    Some(if at_upper > at_median + rule.tolerance * at_median.abs() { by_upper } else { by_median })
}

/// EM from a given start.
#[must_use]
pub fn run(samples: &[f64], start: Mixture, rule: &EmRule) -> Fit {
    let mut mixture = start;
    let mut trace: Vec<f64> = Vec::new();
    while trace.len() < rule.iterations_max {
        let now = mixture.log_likelihood(samples);
        let converged = trace.last().is_some_and(|before| now - before < rule.tolerance * now.abs());
        trace.push(now);
        if converged {
            break;
        }
        mixture = maximise(samples, &mixture, rule);
    }
    Fit { mixture, log_likelihood: trace }
}

/// One E and one M step.
fn maximise(samples: &[f64], old: &Mixture, rule: &EmRule) -> Mixture {
    let mut mass = [0.0; 3];
    let mut first = [0.0; 2];
    let mut shares = Vec::with_capacity(samples.len());
    for &z in samples {
        let classes = old.classes(z);
        let total: f64 = classes.iter().sum();
        let share = classes.map(|c| c / total);
        for (m, s) in mass.iter_mut().zip(share) {
            *m += s;
        }
        first[0] += share[1] * z;
        first[1] += share[2] * z;
        shares.push([share[1], share[2]]);
    }
    let mean = |k: usize, before: f64| if mass[k + 1] >= rule.samples_min { first[k] / mass[k + 1] } else { before };
    let mut means = [mean(0, old.background.mean), mean(1, old.shadow.mean)];
    if means[1] >= means[0] {
        means = [old.background.mean, old.shadow.mean];
    }
    let mut second = [0.0; 2];
    for (&z, share) in samples.iter().zip(&shares) {
        for k in 0..2 {
            second[k] += share[k] * (z - means[k]) * (z - means[k]);
        }
    }
    let sigma = |k: usize, before: f64| {
        if mass[k + 1] >= rule.samples_min { (second[k] / mass[k + 1]).sqrt().max(rule.sigma_min) } else { before }
    };
    let [foreground, background, shadow] = floored(mass.map(|m| m / samples.len() as f64), rule.weight_min);
    Mixture {
        background: Gaussian { mean: means[0], sigma: sigma(0, old.background.sigma) },
        shadow: Gaussian { mean: means[1], sigma: sigma(1, old.shadow.sigma) },
        weights: Weights { foreground, background, shadow },
    }
}

/// The maximum under ω ≥ floor: weights below it are set to it, the others share the rest in proportion; repeated, because
/// sharing may push another one below.
fn floored(weights: [f64; 3], floor: f64) -> [f64; 3] {
    let mut clamped = [false; 3];
    let mut result = weights;
    for _ in 0..3 {
        let free: f64 = weights.iter().zip(clamped).filter(|(_, c)| !c).map(|(w, _)| w).sum();
        let rest = 1.0 - floor * clamped.iter().filter(|&&c| c).count() as f64;
        for k in 0..3 {
            result[k] = if clamped[k] { floor } else { weights[k] * rest / free };
        }
        let mut again = false;
        for k in 0..3 {
            if !clamped[k] && result[k] < floor {
                clamped[k] = true;
                again = true;
            }
        }
        if !again {
            break;
        }
    }
    result
}
