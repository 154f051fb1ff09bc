//! The pixels that say most about motion.

use crate::motion::Places;
use crate::plane::Plane;
use crate::pyramid::{LEVELS, Level};
use crate::resample::Grid;
use crate::vectorised::vectorised;

/// Pixels with a weaker gradient (grey levels a pixel) say nothing about motion but cost as much as the others.
pub(crate) const GRADIENT_MIN: f32 = 2.5;

/// Pixels of the current frame that take part, one list for each of what is known of them.
#[derive(Debug, Clone, Default)]
pub(crate) struct Samples {
    /// Where they are, px.
    pub(crate) at: Places,
    /// Grey levels.
    pub(crate) value: Vec<f32>,
    pub(crate) gradient_u: Vec<f32>,
    pub(crate) gradient_v: Vec<f32>,
}

impl Samples {
    fn resize(&mut self, count: usize) {
        for list in [&mut self.at.u, &mut self.at.v, &mut self.value, &mut self.gradient_u, &mut self.gradient_v] {
            list.resize(count, 0.0);
        }
    }

    /// Every so many of them: as many say as much where only their shares count.
    pub(crate) fn thinned(&self, step: usize) -> Self {
        let thin = |list: &[f32]| list.iter().step_by(step).copied().collect();
        Self {
            at: Places { u: thin(&self.at.u), v: thin(&self.at.v) },
            value: thin(&self.value),
            gradient_u: thin(&self.gradient_u),
            gradient_v: thin(&self.gradient_v),
        }
    }
}

/// About this many samples a level, finest first: the coarse ones need only lead the way.
const ENOUGH: [usize; LEVELS] = [1800, 900, 600];

vectorised! {
    /// The pixel of the strongest gradient in each stretch of a row; stretches and the distance of rows are as large as leaves enough
    /// of them. `moving` marks pixels of the base picture that take no part; the level is `k` halvings smaller.
    pub(crate) fn strongest(level: &Level, k: usize, moving: &Plane<u8>) -> Samples {
        let (width, height) = (level.image.width(), level.image.height());
        let edge = ((width * height / ENOUGH[k.min(LEVELS - 1)]) as f64).sqrt().round().max(1.0) as usize;
        let mut samples = Samples::default();
        samples.resize(width.div_ceil(edge) * height.div_ceil(edge));
        let mut strength = vec![0.0_f32; width];
        let mut count = 0;
        for v in (edge / 2 + 1..height.saturating_sub(1)).step_by(edge) {
            let (row_u, row_v, image) = (level.gradient_u.row(v), level.gradient_v.row(v), level.image.row(v));
            let moving = moving.row((v << k).min(moving.height() - 1));
            for ((s, &gu), &gv) in strength.iter_mut().zip(row_u).zip(row_v) {
                *s = gu * gu + gv * gv;
            }
            for (stretch, strengths) in strength.chunks(edge).enumerate() {
                let (mut best, mut u) = (GRADIENT_MIN * GRADIENT_MIN, 0);
                for (i, &s) in strengths.iter().enumerate() {
                    (best, u) = if s > best { (s, i) } else { (best, u) };
                }
                u += stretch * edge;
                samples.at.u[count] = u as f32;
                samples.at.v[count] = v as f32;
                samples.value[count] = image[u];
                samples.gradient_u[count] = row_u[u];
                samples.gradient_v[count] = row_v[u];
                // What takes no part is written over by the next one.
                count += usize::from((best > GRADIENT_MIN * GRADIENT_MIN) & (moving[(u << k).min(moving.len() - 1)] == 0));
            }
        }
        samples.resize(count);
        samples
    }
}

/// Samples compared with a picture; also the memory for the next comparison.
#[derive(Debug, Default)]
pub(crate) struct Compared {
    places: Places,
    grid: Grid,
    /// Of each sample: the picture's value there less its own. Means nothing outside the picture.
    pub(crate) residuals: Vec<f32>,
}

impl Compared {
    /// How far inside the picture each sample is.
    pub(crate) fn inside(&self) -> &[u8] {
        self.grid.inside()
    }
}

vectorised! {
    /// Compares samples with a picture, brought to their brightness by a gain, where a transform puts them; it is given row by row.
    pub(crate) fn compare(samples: &Samples, picture: &Plane<f32>, gain: f32, transform: [f32; 9], compared: &mut Compared) {
        let Compared { places, grid, residuals } = compared;
        samples.at.transformed(&transform, places);
        grid.set_scattered(places, picture.width(), picture.height());
        residuals.resize(samples.value.len(), 0.0);
        grid.linear(picture, residuals);
        for (residual, value) in residuals.iter_mut().zip(&samples.value) {
            *residual = gain * *residual - value;
        }
    }
}
