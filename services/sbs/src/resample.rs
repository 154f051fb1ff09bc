//! Values between pixels for a row of places: Catmull–Rom for means, linear for variances, nearest for counts.

use crate::motion::Places;
use crate::plane::Plane;

/// One row's places, split into a whole pixel and a share of the way to the next.
#[derive(Debug, Default)]
pub(crate) struct Grid {
    /// Pixel at or left of and above the place; meaningless where `inside` is 0.
    at: Vec<u32>,
    share_u: Vec<f32>,
    share_v: Vec<f32>,
    /// 2: the 4 × 4 pixels around are in the picture, 1: the place is, 0: it is not.
    inside: Vec<u8>,
}

/// Cubic weights of the four neighbours of a place: row k is the factor of tᵏ (Catmull–Rom).
const CUBIC: [[f32; 4]; 4] = [[0.0, 1.0, 0.0, 0.0], [-0.5, 0.0, 0.5, 0.0], [1.0, -2.5, 2.0, -0.5], [-0.5, 1.5, -1.5, 0.5]];

#[inline(always)]
fn weights(t: f32) -> [f32; 4] {
    let mut w = CUBIC[3];
    for k in (0..3).rev() {
        for i in 0..4 {
            w[i] = w[i] * t + CUBIC[k][i];
        }
    }
    w
}

impl Grid {
    /// Splits the places of a row for a picture of a size of at least 2 × 2.
    pub(crate) fn set(&mut self, places: &Places, width: usize, height: usize) {
        self.at.clear();
        self.share_u.clear();
        self.share_v.clear();
        self.inside.clear();
        let (w, h) = (width as f32, height as f32);
        for (&u, &v) in places.u.iter().zip(&places.v) {
            let held = u > -0.5 && v > -0.5 && u < w - 0.5 && v < h - 0.5;
            let whole = u >= 1.0 && v >= 1.0 && u < w - 2.0 && v < h - 2.0;
            // Within half a pixel of the border the border's own value stands.
            let u = if u > 0.0 { if u < w - 1.0 { u } else { w - 1.0 } } else { 0.0 };
            let v = if v > 0.0 { if v < h - 1.0 { v } else { h - 1.0 } } else { 0.0 };
            let (iu, iv) = ((u as i32).min(width as i32 - 2), (v as i32).min(height as i32 - 2));
            self.at.push((iv * width as i32 + iu) as u32);
            self.share_u.push(u - iu as f32);
            self.share_v.push(v - iv as f32);
            self.inside.push(u8::from(held) + u8::from(whole));
        }
    }

    /// Which pixels of the row have a place in the picture.
    pub(crate) fn inside(&self) -> &[u8] {
        &self.inside
    }

    /// Catmull–Rom where all sixteen neighbours are in the picture, linear at its border.
    pub(crate) fn cubic(&self, from: &Plane<f32>, out: &mut [f32]) {
        let (stride, values) = (from.width(), from.values());
        for ((((o, &at), &tu), &tv), &inside) in out.iter_mut().zip(&self.at).zip(&self.share_u).zip(&self.share_v).zip(&self.inside) {
            let at = at as usize;
            *o = if inside == 2 {
                let (wu, wv) = (weights(tu), weights(tv));
                let block = &values[at - stride - 1..at + 2 * stride + 3];
                let mut column = [0.0_f32; 4];
                for (j, &wv) in wv.iter().enumerate() {
                    let row = &block[j * stride..j * stride + 4];
                    for i in 0..4 {
                        column[i] += wv * row[i];
                    }
                }
                (column[0] * wu[0] + column[2] * wu[2]) + (column[1] * wu[1] + column[3] * wu[3])
            } else {
                mix(values, at, stride, tu, tv)
            };
        }
    }

    /// Linear along both axes.
    pub(crate) fn linear(&self, from: &Plane<f32>, out: &mut [f32]) {
        let (stride, values) = (from.width(), from.values());
        for (((o, &at), &tu), &tv) in out.iter_mut().zip(&self.at).zip(&self.share_u).zip(&self.share_v) {
            *o = mix(values, at as usize, stride, tu, tv);
        }
    }

    /// The value of the nearest pixel.
    pub(crate) fn nearest<T: Copy>(&self, from: &Plane<T>, out: &mut [T]) {
        let (stride, values) = (from.width(), from.values());
        for (((o, &at), &tu), &tv) in out.iter_mut().zip(&self.at).zip(&self.share_u).zip(&self.share_v) {
            *o = values[at as usize + usize::from(tu >= 0.5) + if tv >= 0.5 { stride } else { 0 }];
        }
    }
}

#[inline(always)]
fn mix(values: &[f32], at: usize, stride: usize, tu: f32, tv: f32) -> f32 {
    let block = &values[at..at + stride + 2];
    let top = block[0] + tu * (block[1] - block[0]);
    let bottom = block[stride] + tu * (block[stride + 1] - block[stride]);
    top + tv * (bottom - top)
}
