//! The background update as printed (Table 2, after Ren, Chua & Ho 2003): up to K Gaussians a pixel.
//!
//! Table 2's "mean ← x̂" is the pixel's *value*; its D is `(z − μ)² / σ²`, compared with k². The moving-camera model of
//! [`crate::background`] is this rule for one Gaussian and one candidate, with the limits a moving camera needs.

/// What Table 2 leaves to the reader.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Table2Rule {
    /// K: most Gaussians a pixel has.
    pub gaussians_max: usize,
    /// D: largest squared, normalised distance of a hit (k²).
    pub distance_max: f64,
    /// Variance of a new Gaussian, σ².
    pub variance_start: f64,
    /// Smallest variance.
    pub variance_min: f64,
    /// The gain of an update is 1 / min(count, this).
    pub count_cap: u32,
}

/// One Gaussian of a pixel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Counted {
    /// Mean, grey levels.
    pub mean: f64,
    /// Variance, grey levels².
    pub variance: f64,
    /// Values it has taken.
    pub count: u32,
}

/// The Gaussians of one pixel.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct PixelGaussians {
    gaussians: Vec<Counted>,
}

/// What a value did to a pixel.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Taken {
    /// The Gaussian that took the value.
    pub gaussian: usize,
    /// Whether it was made for it.
    pub new: bool,
}

impl PixelGaussians {
    /// The Gaussians, in the order in which they came.
    #[must_use]
    pub fn gaussians(&self) -> &[Counted] {
        &self.gaussians
    }

    /// The Gaussian that is the background: the one that took most values, the earlier one of equals.
    #[must_use]
    pub fn background(&self) -> Option<usize> {
        (0..self.gaussians.len()).rev().max_by_key(|&i| self.gaussians[i].count)
    }

    /// One round of Table 2 for one pixel. When K Gaussians are there already, a value that hits none replaces the one that
    /// took fewest.
    pub fn update(&mut self, z: f64, rule: &Table2Rule) -> Taken {
        let distance = |g: &Counted| (z - g.mean) * (z - g.mean) / g.variance;
        let nearest = (0..self.gaussians.len()).min_by(|&a, &b| distance(&self.gaussians[a]).total_cmp(&distance(&self.gaussians[b])));
        if let Some(hit) = nearest.filter(|&i| distance(&self.gaussians[i]) <= rule.distance_max) {
            let g = &mut self.gaussians[hit];
            g.count = g.count.saturating_add(1);
            let gain = 1.0 / f64::from(g.count.min(rule.count_cap).max(1));
            let before = z - g.mean;
            g.mean += gain * before;
            g.variance = (g.variance + gain * (before * (z - g.mean) - g.variance)).max(rule.variance_min);
            return Taken { gaussian: hit, new: false };
        }
        let fresh = Counted { mean: z, variance: rule.variance_start, count: 1 };
        if self.gaussians.len() < rule.gaussians_max.max(1) {
            self.gaussians.push(fresh);
            return Taken { gaussian: self.gaussians.len() - 1, new: true };
        }
        let fewest = (0..self.gaussians.len()).min_by_key(|&i| self.gaussians[i].count).unwrap_or(0);
        self.gaussians[fewest] = fresh;
        Taken { gaussian: fewest, new: true }
    }
}
