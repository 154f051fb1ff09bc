//! A picture at several scales, with its gradient, for motion estimation.

use crate::plane::Plane;
use crate::vectorised::vectorised;

/// Levels of the pyramid.
pub(crate) const LEVELS: usize = 3;

/// One scale.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct Level {
    /// The picture, smoothed with the 3 × 3 binomial against noise.
    pub(crate) image: Plane<f32>,
    /// Half the difference of the right and the left neighbour.
    pub(crate) gradient_u: Plane<f32>,
    /// Half the difference of the lower and the upper neighbour.
    pub(crate) gradient_v: Plane<f32>,
}

/// Scales 1, 1/2, 1/4 of the base picture, finest first.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct Pyramid {
    pub(crate) levels: [Level; LEVELS],
}

impl Pyramid {
    /// Becomes the pyramid of a base picture that is smoothed already, in the memory that it has.
    pub(crate) fn rebuild(&mut self, base: Plane<f32>) {
        let [finest, coarser @ ..] = &mut self.levels;
        finest.image = base;
        let mut finer = &finest.image;
        for level in coarser {
            halve(finer, &mut level.image);
            finer = &level.image;
        }
        for level in &mut self.levels {
            gradients(&level.image, &mut level.gradient_u, &mut level.gradient_v);
        }
    }

    /// The finest level.
    pub(crate) fn base(&self) -> &Level {
        &self.levels[0]
    }
}

/// The picture that motion is estimated in: halved `halvings` times, then smoothed with the 3 × 3 binomial.
pub(crate) fn base(picture: &Plane<f32>, halvings: u32) -> Plane<f32> {
    let mut reduced = Plane::default();
    let mut source = picture;
    let mut smaller = Plane::default();
    for _ in 0..halvings {
        halve(source, &mut smaller);
        std::mem::swap(&mut reduced, &mut smaller);
        source = &reduced;
        smaller = Plane::default();
    }
    smoothed(source)
}

vectorised! {
    /// The 3 × 3 binomial, border pixels repeated.
    fn smoothed(picture: &Plane<f32>) -> Plane<f32> {
        let (width, height) = (picture.width(), picture.height());
        let mut out = Plane::filled(width, height, 0.0);
        let mut column = vec![0.0_f32; width + 2];
        for v in 0..height {
            let above = picture.row(v.saturating_sub(1));
            let here = picture.row(v);
            let below = picture.row((v + 1).min(height - 1));
            for (((c, &a), &h), &b) in column[1..].iter_mut().zip(above).zip(here).zip(below) {
                *c = 0.25 * (a + 2.0 * h + b);
            }
            column[0] = column[1];
            column[width + 1] = column[width];
            let (left, middle, right) = (&column[..width], &column[1..=width], &column[2..]);
            for (((o, &l), &m), &r) in out.row_mut(v).iter_mut().zip(left).zip(middle).zip(right) {
                *o = 0.25 * (l + 2.0 * m + r);
            }
        }
        out
    }
}

vectorised! {
    /// Half the size: the mean of each 2 × 2; an odd last row or column is left out.
    pub(crate) fn halve(picture: &Plane<f32>, out: &mut Plane<f32>) {
        let (width, height) = (picture.width() / 2, picture.height() / 2);
        out.reshape(width, height, 0.0);
        for v in 0..height {
            let (upper, lower) = (picture.row(2 * v), picture.row(2 * v + 1));
            for ((o, a), b) in out.row_mut(v).iter_mut().zip(upper.chunks_exact(2)).zip(lower.chunks_exact(2)) {
                *o = 0.25 * (a[0] + a[1] + b[0] + b[1]);
            }
        }
    }
}

vectorised! {
    fn gradients(image: &Plane<f32>, du: &mut Plane<f32>, dv: &mut Plane<f32>) {
        let (width, height) = (image.width(), image.height());
        // The border stays 0.
        du.reshape(width, height, 0.0);
        dv.reshape(width, height, 0.0);
        for v in 0..height {
            let row = image.row(v);
            if let (Some(inner), Some(right)) = (du.row_mut(v).get_mut(1..), row.get(2..)) {
                for ((d, &l), &r) in inner.iter_mut().zip(row).zip(right) {
                    *d = 0.5 * (r - l);
                }
            }
            if v > 0 && v + 1 < height {
                for ((d, &a), &b) in dv.row_mut(v).iter_mut().zip(image.row(v - 1)).zip(image.row(v + 1)) {
                    *d = 0.5 * (b - a);
                }
            }
        }
    }
}
