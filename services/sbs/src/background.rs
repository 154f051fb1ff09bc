//! The background of each pixel: a Gaussian and a candidate (Table 2 for a moving camera).

/// The update rule.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BackgroundRule {
    /// k: a value within k σ of B is background.
    pub k: f32,
    /// σ of a Gaussian that has seen one value, grey levels.
    pub sigma_start: f32,
    /// Smallest σ, grey levels.
    pub sigma_min: f32,
    /// Largest σ, grey levels: unbounded, accepted pixels widen their own variance until everything is accepted.
    pub sigma_max: f32,
    /// Innovations of the mean are clipped to this many σ.
    pub clip: f32,
    /// The gain of an update is 1 / min(count, this).
    pub count_cap: u8,
    /// A candidate takes over after more values than this.
    pub takeover: u8,
    /// The same where the compensated frame difference is still.
    pub takeover_still: u8,
}

impl Default for BackgroundRule {
    fn default() -> Self {
        Self { k: 3.0, sigma_start: 8.0, sigma_min: 2.5, sigma_max: 8.0, clip: 2.0, count_cap: 40, takeover: 60, takeover_still: 12 }
    }
}

/// Up to this count a Gaussian keeps the variance it started with: three values do not tell one.
pub(crate) const VARIANCE_HELD: u8 = 3;

/// A Gaussian and the number of values it has taken.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Estimate {
    /// Mean, grey levels.
    pub mean: f32,
    /// Variance, grey levels².
    pub variance: f32,
    /// Values taken; 0: none, the rest means nothing.
    pub count: u8,
}

/// `f32::clamp` without its order for NaN, which costs the vector units more than the comparison.
#[inline(always)]
fn within(x: f32, low: f32, high: f32) -> f32 {
    let x = if x < low { low } else { x };
    if x > high { high } else { x }
}

impl Estimate {
    /// A Gaussian that has seen one value.
    #[must_use]
    pub fn new(z: f32, rule: &BackgroundRule) -> Self {
        Self { mean: z, variance: rule.sigma_start * rule.sigma_start, count: 1 }
    }

    /// This Gaussian after a value that it accepts. Written without branches: whole rows of pixels go through it.
    #[must_use]
    #[inline(always)]
    pub fn updated(self, z: f32, rule: &BackgroundRule) -> Self {
        let count = self.count.saturating_add(1).min(rule.count_cap);
        let gain = 1.0 / f32::from(count);
        let reach = rule.clip * self.variance.sqrt();
        let d = within(z - self.mean, -reach, reach);
        let learned =
            within(self.variance + gain * (d * d - self.variance), rule.sigma_min * rule.sigma_min, rule.sigma_max * rule.sigma_max);
        Self { mean: self.mean + gain * d, variance: if count > VARIANCE_HELD { learned } else { self.variance }, count }
    }

    /// Whether a value is within k σ.
    #[must_use]
    #[inline(always)]
    pub fn accepts(&self, z: f32, k: f32) -> bool {
        let d = z - self.mean;
        d * d <= k * k * self.variance
    }

    /// A candidate after a value that its pixel's B does not accept. Without branches: which way they go is chance.
    #[must_use]
    #[inline(always)]
    pub fn fed(self, z: f32, rule: &BackgroundRule) -> Self {
        let continues = (self.count > 0) & self.accepts(z, rule.k);
        let count = self.count.saturating_add(1);
        let gain = 1.0 / f32::from(count.min(rule.count_cap));
        let d = z - self.mean;
        let variance =
            within(self.variance + gain * (d * d - self.variance), rule.sigma_min * rule.sigma_min, rule.sigma_max * rule.sigma_max);
        let fresh = Self::new(z, rule);
        Self {
            mean: if continues { self.mean + gain * d } else { fresh.mean },
            variance: if continues { variance } else { fresh.variance },
            count: if continues { count } else { fresh.count },
        }
    }

    /// Whether a candidate has seen enough to take over; `still` says that the compensated frame difference is still here.
    #[must_use]
    #[inline]
    pub fn takes_over(&self, still: bool, rule: &BackgroundRule) -> bool {
        self.count > if still { rule.takeover_still.min(rule.takeover) } else { rule.takeover }
    }

    /// A candidate that takes over. Its variance is learned already, so it is not held again.
    #[must_use]
    pub fn as_background(self) -> Self {
        Self { count: VARIANCE_HELD, ..self }
    }

    /// A background that was taken over.
    #[must_use]
    pub fn as_candidate(self) -> Self {
        Self { count: 0, ..self }
    }
}
