//! Background in shadow (S of eq. 4).
//!
//! S alone swallows dark clothing in grey images: it counts only below the horizon row and where the ratio to B is locally
//! constant. Where S was not learned it is any ratio that a shadow indoors has.

use crate::components::{Run, runs};
use crate::model::Model;
use crate::plane::Plane;

/// What is shadow.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ShadowRule {
    /// Smallest ratio of value to B where S was not learned.
    pub ratio_min: f32,
    /// Largest ratio of value to B where S was not learned.
    pub ratio_max: f32,
    /// Largest standard deviation of the ratio among the foreground pixels of the 3 × 3 around.
    pub spread_max: f32,
}

impl Default for ShadowRule {
    fn default() -> Self {
        Self { ratio_min: 0.55, ratio_max: 0.97, spread_max: 0.06 }
    }
}

/// Takes out of the foreground what is shadow, from row `first` downwards; k as for B.
pub(crate) fn dropped(foreground: &Plane<u8>, picture: &Plane<f32>, model: &Model, first: usize, k: f32, rule: &ShadowRule) -> Plane<u8> {
    let mut out = foreground.clone();
    let (width, height) = (picture.width(), picture.height());
    let mean = &model.background.mean;
    for Run { row: v, start, end, .. } in runs(foreground).into_iter().filter(|run| run.row >= first) {
        for u in start..end {
            let at = v * width + u;
            let value = picture.values()[at] / mean.values()[at].max(1.0);
            let learned = model.shadow.as_ref().is_some_and(|s| {
                let (ratio, sigma) = (s.ratio.values()[at], s.sigma.values()[at]);
                ratio > 0.0 && (picture.values()[at] - ratio * mean.values()[at]).abs() <= k * sigma
            });
            if !learned && value >= 1.0 {
                continue;
            }
            let (mut count, mut sum, mut squares) = (0.0_f32, 0.0, 0.0);
            for nv in v.saturating_sub(1).max(first)..(v + 2).min(height) {
                for nu in u.saturating_sub(1)..(u + 2).min(width) {
                    let near = nv * width + nu;
                    if foreground.values()[near] != 0 {
                        let ratio = picture.values()[near] / mean.values()[near].max(1.0);
                        count += 1.0;
                        sum += ratio;
                        squares += ratio * ratio;
                    }
                }
            }
            let ratio = sum / count;
            let spread = (squares / count - ratio * ratio).max(0.0).sqrt();
            if spread < rule.spread_max && (learned || (ratio > rule.ratio_min && ratio < rule.ratio_max)) {
                out.values_mut()[at] = 0;
            }
        }
    }
    out
}
