//! A textured wall, a camera that moves before it and a figure that walks by.

use messages::{FrameLayout, PixelFormat};

/// Nanoseconds between frames.
pub(crate) const PERIOD_NS: u64 = 66_666_667;

/// Pseudo-random grey level of a lattice point, −1 to 1.
fn lattice(i: i64, j: i64, seed: u64) -> f64 {
    let mut x =
        (i as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ (j as u64).wrapping_mul(0xc2b2_ae3d_27d4_eb4f) ^ seed.wrapping_mul(0x1656_67b1);
    x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    ((x ^ (x >> 31)) >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
}

/// Smooth noise of a wavelength of about 9 px.
fn texture(u: f64, v: f64, seed: u64) -> f64 {
    let (x, y) = (u / 9.0, v / 9.0);
    let (i, j) = (x.floor(), y.floor());
    let smooth = |t: f64| t * t * (3.0 - 2.0 * t);
    let (s, t) = (smooth(x - i), smooth(y - j));
    let at = |di: i64, dj: i64| lattice(i as i64 + di, j as i64 + dj, seed);
    (1.0 - t) * ((1.0 - s) * at(0, 0) + s * at(1, 0)) + t * ((1.0 - s) * at(0, 1) + s * at(1, 1))
}

/// Where the figure is: left, top, width, height, px.
pub(crate) type Figure = [f64; 4];

/// A grey picture: the wall seen from `camera` (px), before it the figure; `frame` seeds the noise.
pub(crate) fn picture(width: usize, height: usize, camera: [f64; 2], figure: Option<Figure>, frame: u64) -> Vec<u8> {
    let mut bytes = Vec::with_capacity(width * height);
    for v in 0..height {
        for u in 0..width {
            let (x, y) = (u as f64, v as f64);
            let mut z = 120.0 + 45.0 * texture(x + camera[0], y + camera[1], 1);
            if let Some([left, top, w, h]) = figure
                && (left..left + w).contains(&x)
                && (top..top + h).contains(&y)
            {
                z = 60.0 + 40.0 * texture(x - left, y - top, 2);
            }
            z += 2.0 * lattice(u as i64, v as i64, 100 + frame);
            bytes.push(z.round().clamp(0.0, 255.0) as u8);
        }
    }
    bytes
}

/// The layout of a grey picture.
pub(crate) fn grey(width: usize, height: usize) -> FrameLayout {
    FrameLayout { width: width as u32, height: height as u32, stride: width as u32, format: PixelFormat::Grey as u32 }
}
