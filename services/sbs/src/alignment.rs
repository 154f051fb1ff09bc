//! The alignment Gaussian model (AGM, eqs. 5–10): where in the background frame a pixel may really be.

use crate::transform::Transform;

/// A covariance in px², symmetric.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Covariance {
    /// Variance along u.
    pub uu: f64,
    /// Covariance of u and v.
    pub uv: f64,
    /// Variance along v.
    pub vv: f64,
}

/// A landmark and its counterpart (L_F and L_B of section 5.1 of the paper).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pair {
    /// Place in the current frame, px.
    pub frame: [f64; 2],
    /// Place in the background frame, px.
    pub background: [f64; 2],
}

impl Covariance {
    /// Σ̂ of the residuals of pairs under T (eq. 9), in the background frame: the paper's eqs. 9 and 10 run the other way round
    /// from its text. Zero without pairs.
    #[must_use]
    pub fn of_residuals(transform: &Transform, pairs: &[Pair]) -> Self {
        let mut sum = Self { uu: 0.0, uv: 0.0, vv: 0.0 };
        for pair in pairs {
            let [u, v] = transform.apply(pair.frame);
            let (du, dv) = (pair.background[0] - u, pair.background[1] - v);
            sum = Self { uu: sum.uu + du * du, uv: sum.uv + du * dv, vv: sum.vv + dv * dv };
        }
        sum.times(1.0 / pairs.len().max(1) as f64)
    }

    /// Σ = β Σ̂ (eq. 8).
    #[must_use]
    pub fn times(self, beta: f64) -> Self {
        Self { uu: beta * self.uu, uv: beta * self.uv, vv: beta * self.vv }
    }

    /// The root of the mean squared length of the residuals, px.
    #[must_use]
    pub fn rms(self) -> f64 {
        (self.uu + self.vv).max(0.0).sqrt()
    }

    /// Whether any other pixel than the nearest can lie in the region of a place, D ≤ ħ.
    ///
    /// The region's half width along u is √(ħ Σ_uu): below half a pixel it holds no neighbour wherever in the pixel the place is.
    #[must_use]
    pub fn is_one_pixel(self, h_bar: f64) -> bool {
        (h_bar * self.uu.max(self.vv)).sqrt() < 0.5
    }
}

/// A pixel of the region, with its D (eq. 7).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RegionPixel {
    /// Column.
    pub u: i64,
    /// Row.
    pub v: i64,
    /// D of eq. 7.
    pub distance: f64,
}

/// The pixels with `D = (x − x̂)ᵀ Σ⁻¹ (x − x̂) ≤ ħ` (eqs. 6 and 7), row by row; a region smaller than a pixel is that pixel.
#[must_use]
pub fn region(centre: [f64; 2], sigma: Covariance, h_bar: f64) -> Vec<RegionPixel> {
    let determinant = sigma.uu * sigma.vv - sigma.uv * sigma.uv;
    let nearest = RegionPixel { u: centre[0].round() as i64, v: centre[1].round() as i64, distance: 0.0 };
    if !(determinant > 0.0 && sigma.uu > 0.0 && h_bar >= 0.0 && centre.iter().all(|c| c.is_finite())) {
        return vec![nearest];
    }
    let distance = |u: i64, v: i64| {
        let (du, dv) = (u as f64 - centre[0], v as f64 - centre[1]);
        (sigma.vv * du * du - 2.0 * sigma.uv * du * dv + sigma.uu * dv * dv) / determinant
    };
    // A region wider than this could only come from a transform that fits nothing.
    const WIDEST_PX: f64 = 16.0;
    let (wide, high) = ((h_bar * sigma.uu).sqrt().min(WIDEST_PX), (h_bar * sigma.vv).sqrt().min(WIDEST_PX));
    let mut pixels = Vec::new();
    for v in (centre[1] - high).floor() as i64..=(centre[1] + high).ceil() as i64 {
        for u in (centre[0] - wide).floor() as i64..=(centre[0] + wide).ceil() as i64 {
            let d = distance(u, v);
            if d <= h_bar {
                pixels.push(RegionPixel { u, v, distance: d });
            }
        }
    }
    if pixels.is_empty() {
        pixels.push(RegionPixel { distance: distance(nearest.u, nearest.v), ..nearest });
    }
    pixels
}
