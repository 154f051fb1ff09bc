//! Training: eq. 4 of every pixel from the first frames, while the robot stands still.

use crate::background::{BackgroundRule, VARIANCE_HELD};
use crate::mixture::{EmRule, learn};
use crate::model::{LearnedShadow, Model};
use crate::plane::Plane;

/// Frames of a camera that has not moved since the first of them, as bytes.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct Training {
    pub(crate) frames: Vec<Plane<u8>>,
}

/// S is kept where it explains at least this share of a pixel's values.
const SHADOW_WEIGHT_MIN: f64 = 0.05;

impl Training {
    /// Adds a frame, brought to the brightness of the first one: `gain` is its own over that.
    pub(crate) fn push(&mut self, picture: &Plane<f32>, gain: f32) {
        let values = picture.values().iter().map(|&z| (z / gain + 0.5) as u8).collect();
        self.frames.extend(Plane::from_values(picture.width(), picture.height(), values));
    }

    /// The model of these frames, B and S of every pixel by EM.
    pub(crate) fn model(&self, picture: &Plane<f32>, rule: &BackgroundRule) -> Model {
        let mut model = Model::unknown(picture, rule);
        let (width, height) = (picture.width(), picture.height());
        let mut shadow = LearnedShadow { ratio: Plane::filled(width, height, 0.0), sigma: Plane::filled(width, height, 0.0) };
        // A few dozen values do not need the last digits of the likelihood.
        let em = EmRule { tolerance: 1e-6, iterations_max: 60, ..EmRule::default() };
        let count = self.frames.len().min(usize::from(rule.count_cap)) as u8;
        let (low, high) = (rule.sigma_min * rule.sigma_min, rule.sigma_max * rule.sigma_max);
        let mut samples = Vec::with_capacity(self.frames.len());
        for at in 0..width * height {
            samples.clear();
            samples.extend(self.frames.iter().map(|f| f64::from(f.values()[at])));
            let (mean, variance) = match one_cluster(&samples, &em) {
                Some(found) => found,
                None => {
                    let Some(fit) = learn(&samples, &em) else { continue };
                    let m = fit.mixture;
                    if m.weights.shadow >= SHADOW_WEIGHT_MIN && m.background.mean > 1.0 {
                        shadow.ratio.values_mut()[at] = (m.shadow.mean / m.background.mean) as f32;
                        shadow.sigma.values_mut()[at] = (m.shadow.sigma as f32).min(rule.sigma_max);
                    }
                    (m.background.mean, m.background.sigma * m.background.sigma)
                }
            };
            model.background.mean.values_mut()[at] = mean as f32;
            model.background.variance.values_mut()[at] = (variance as f32).clamp(low, high);
            model.background.count.values_mut()[at] = count.max(VARIANCE_HELD);
        }
        model.shadow = Some(shadow);
        model
    }
}

/// Mean and variance of samples that all lie within four of their standard deviations (or of σ_min): EM leaves F and S at their
/// floors there, as the golden case without foreground and shadow shows, at a hundred times the cost.
fn one_cluster(samples: &[f64], rule: &EmRule) -> Option<(f64, f64)> {
    let count = samples.len() as f64;
    let mean = samples.iter().sum::<f64>() / count;
    let variance = (samples.iter().map(|z| (z - mean) * (z - mean)).sum::<f64>() / count).max(rule.sigma_min * rule.sigma_min);
    let sigma = variance.sqrt();
    let one = sigma <= rule.start_sigma_max * 0.5 && samples.iter().all(|z| (z - mean).abs() <= 4.0 * sigma);
    one.then_some((mean, variance))
}
