//! The background of all pixels, in the frame it was last resampled into.

use crate::background::{BackgroundRule, Estimate};
use crate::motion::{Motion, Places};
use crate::plane::Plane;
use crate::resample::Grid;
use crate::vectorised::vectorised;

/// A mask's pixel that is set.
pub(crate) const SET: u8 = 255;

/// One Gaussian a pixel.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct Gaussians {
    pub(crate) mean: Plane<f32>,
    pub(crate) variance: Plane<f32>,
    pub(crate) count: Plane<u8>,
}

/// S where it was learned: its mean as a share of B's, and its σ; 0 where it was not.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct LearnedShadow {
    pub(crate) ratio: Plane<f32>,
    pub(crate) sigma: Plane<f32>,
}

/// B and candidate of every pixel, and S where it was learned.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct Model {
    pub(crate) background: Gaussians,
    pub(crate) candidate: Gaussians,
    pub(crate) shadow: Option<LearnedShadow>,
}

impl Gaussians {
    fn filled(mean: Plane<f32>, variance: f32, count: u8) -> Self {
        let (width, height) = (mean.width(), mean.height());
        Self { mean, variance: Plane::filled(width, height, variance), count: Plane::filled(width, height, count) }
    }

    fn get(&self, at: usize) -> Estimate {
        Estimate { mean: self.mean.values()[at], variance: self.variance.values()[at], count: self.count.values()[at] }
    }

    fn set(&mut self, at: usize, e: Estimate) {
        self.mean.values_mut()[at] = e.mean;
        self.variance.values_mut()[at] = e.variance;
        self.count.values_mut()[at] = e.count;
    }
}

impl Model {
    /// A model that has seen nothing: every pixel will start with its first value, as in Table 2.
    pub(crate) fn unknown(picture: &Plane<f32>, rule: &BackgroundRule) -> Self {
        let background = Gaussians::filled(picture.clone(), rule.sigma_start * rule.sigma_start, 0);
        Self { candidate: background.clone(), background, shadow: None }
    }

    /// Becomes `old` in the frame of `picture`: means by Catmull–Rom (bilinear loses 0.07 F1 when driving), variance bilinear
    /// (nearest loses 0.02), counts and candidates nearest: most pixels have no candidate, and bilinear is no better. A pixel that
    /// comes from outside is unknown.
    pub(crate) fn resample(&mut self, old: &Self, motion: &Motion, picture: &Plane<f32>, rule: &BackgroundRule) {
        let (width, height) = (picture.width(), picture.height());
        if (self.background.mean.width(), self.background.mean.height()) != (width, height) {
            *self = Self::unknown(picture, rule);
        }
        self.shadow.clone_from(&old.shadow);
        let (mut places, mut grid) = (Places::default(), Grid::default());
        for v in 0..height {
            resample_row(self, v, old, motion, &mut places, &mut grid);
            if let (Some(old), Some(new)) = (&old.shadow, &mut self.shadow) {
                grid.nearest(&old.ratio, new.ratio.row_mut(v));
                grid.nearest(&old.sigma, new.sigma.row_mut(v));
            }
            if grid.inside().contains(&0) {
                self.forget_outside(v, grid.inside(), picture.row(v), rule);
            }
        }
    }

    fn forget_outside(&mut self, v: usize, inside: &[u8], values: &[f32], rule: &BackgroundRule) {
        let width = values.len();
        for (u, (&inside, &z)) in inside.iter().zip(values).enumerate() {
            if inside == 0 {
                let at = v * width + u;
                let unknown = Estimate { count: 0, ..Estimate::new(z, rule) };
                self.background.set(at, unknown);
                self.candidate.set(at, unknown);
                if let Some(shadow) = &mut self.shadow {
                    shadow.ratio.values_mut()[at] = 0.0;
                    shadow.sigma.values_mut()[at] = 0.0;
                }
            }
        }
    }

    /// Brings the model to the brightness of the current frame, updates B where the frame's value matches it and gives the mask
    /// of the pixels where it does not.
    pub(crate) fn match_values(&mut self, picture: &Plane<f32>, gain: f32, rule: &BackgroundRule) -> Plane<u8> {
        let mut unmatched = Plane::filled(picture.width(), picture.height(), 0_u8);
        let b = &mut self.background;
        let rows = picture.width().max(1);
        let planes = picture
            .values()
            .chunks(rows)
            .zip(b.mean.values_mut().chunks_mut(rows))
            .zip(b.variance.values_mut().chunks_mut(rows))
            .zip(b.count.values_mut().chunks_mut(rows))
            .zip(unmatched.values_mut().chunks_mut(rows));
        for ((((z, mean), variance), count), out) in planes {
            match_row(z, mean, variance, count, out, gain, rule);
        }
        self.candidate.mean.values_mut().iter_mut().for_each(|mean| *mean *= gain);
        unmatched
    }

    /// Whether B of any of the pixels at these offsets accepts a value (the region of eq. 6).
    pub(crate) fn explained_around(&self, u: usize, v: usize, z: f32, offsets: &[(isize, isize)], k: f32) -> bool {
        let b = &self.background;
        offsets.iter().any(|&(du, dv)| {
            let (u, v) = (u as isize + du, v as isize + dv);
            let (mean, variance) = (b.mean.nearest(u, v), b.variance.nearest(u, v));
            Estimate { mean, variance, count: 1 }.accepts(z, k)
        })
    }

    /// Feeds the unmatched value of a pixel to its candidate.
    #[inline(always)]
    pub(crate) fn feed_candidate(&mut self, at: usize, z: f32, still: bool, rule: &BackgroundRule) {
        let candidate = self.candidate.get(at).fed(z, rule);
        if candidate.takes_over(still, rule) {
            let old = self.background.get(at);
            self.background.set(at, candidate.as_background());
            self.candidate.set(at, old.as_candidate());
        } else {
            self.candidate.set(at, candidate);
        }
    }
}

vectorised! {
    fn match_row(z: &[f32], mean: &mut [f32], variance: &mut [f32], count: &mut [u8], out: &mut [u8], gain: f32, rule: &BackgroundRule) {
        for ((((z, mean), variance), count), out) in z.iter().zip(mean).zip(variance).zip(count).zip(out) {
            let old = Estimate { mean: *mean * gain, variance: *variance, count: *count };
            let hit = old.accepts(*z, rule.k);
            let new = old.updated(*z, rule);
            *mean = if hit { new.mean } else { old.mean };
            *variance = if hit { new.variance } else { old.variance };
            *count = if hit { new.count } else { old.count };
            *out = if hit { 0 } else { SET };
        }
    }
}

vectorised! {
    /// Row `v` of a model resampled, all but its shadow. Splits the row's places for whatever else is resampled.
    fn resample_row(new: &mut Model, v: usize, old: &Model, motion: &Motion, places: &mut Places, grid: &mut Grid) {
        let (width, height) = (old.background.mean.width(), old.background.mean.height());
        motion.places(v, width, places);
        grid.set(places, width, height);
        let (background, candidate) = (&mut new.background, &mut new.candidate);
        grid.cubic(&old.background.mean, background.mean.row_mut(v));
        grid.linear(&old.background.variance, background.variance.row_mut(v));
        grid.nearest(&old.background.count, background.count.row_mut(v));
        grid.nearest(&old.candidate.count, candidate.count.row_mut(v));
        grid.nearest(&old.candidate.mean, candidate.mean.row_mut(v));
        grid.nearest(&old.candidate.variance, candidate.variance.row_mut(v));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use serde_json::Value;

    /// As many pixels as the vector units take at once, and a few.
    const WIDTH: usize = 19;

    /// Pixels that have seen 100 once.
    fn trained(rule: &BackgroundRule) -> Model {
        let picture = Plane::filled(WIDTH, 1, 100.0);
        let mut model = Model::unknown(&picture, rule);
        model.match_values(&picture, 1.0, rule);
        model
    }

    /// Gives every pixel this value, as in a frame of a camera that stands still; the mask.
    fn see(model: &mut Model, z: f32, still: bool, rule: &BackgroundRule) -> Plane<u8> {
        let unmatched = model.match_values(&Plane::filled(WIDTH, 1, z), 1.0, rule);
        (0..WIDTH).filter(|at| unmatched.values()[*at] == SET).for_each(|at| model.feed_candidate(at, z, still, rule));
        unmatched
    }

    #[test]
    fn background_and_candidate_agree_with_the_golden_values() {
        // The file's rule: cmax 40, burn 6, smin 2.5, sinit 8, smax 8, clip 2, k 3; it starts from a pixel that has seen 100.
        let rule = BackgroundRule { takeover: 6, takeover_still: 6, ..BackgroundRule::default() };
        let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/data/sbs/golden.json");
        let golden: Value = serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap();
        let mut model = trained(&rule);
        for (step, expected) in golden["b_and_candidate"]["trace"].as_array().unwrap().iter().enumerate() {
            let number = |name: &str| expected[name].as_f64().unwrap();
            let unmatched = see(&mut model, number("z") as f32, false, &rule);
            for at in 0..WIDTH {
                assert_eq!(u64::from(unmatched.values()[at]), expected["label"].as_u64().unwrap(), "value {step}, pixel {at}");
                let (b, c) = (model.background.get(at), model.candidate.get(at));
                for (name, found) in [("MU", b.mean), ("VA", b.variance), ("CM", c.mean), ("CV", c.variance)] {
                    let difference = (f64::from(found) - number(name)).abs();
                    assert!(difference <= 1e-5 * number(name).abs().max(1.0), "{name} after value {step}, pixel {at}: {found}");
                }
                assert_eq!((f64::from(b.count), f64::from(c.count)), (number("CN"), number("CC")), "value {step}, pixel {at}");
            }
        }
    }

    proptest! {
        #[test]
        fn any_values_leave_the_gaussians_within_their_limits(values in proptest::collection::vec((0_u8..=255, any::<bool>()), 1..300)) {
            let rule = BackgroundRule::default();
            let mut model = trained(&rule);
            for (z, still) in values {
                see(&mut model, f32::from(z), still, &rule);
                let background = model.background.get(0);
                let sigma = background.variance.sqrt();
                prop_assert!((rule.sigma_min - 1e-3..=rule.sigma_max + 1e-3).contains(&sigma));
                prop_assert!((0.0..=255.0).contains(&background.mean) && background.count <= rule.count_cap);
            }
        }
    }
}
