//! Values between pixels for a row of places: Catmull–Rom for means, linear for variances, nearest for counts.

use crate::motion::Places;
use crate::plane::{Plane, mix};
use crate::rounding::{below, limited, whole_number};

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

/// Places are told apart to this part of a pixel.
const PHASES: usize = 64;

/// Cubic weights of the four neighbours of a place at each phase of the way from the second to the third (Catmull–Rom).
static CUBIC: [[f32; 4]; PHASES + 1] = cubic_table();

const fn cubic_table() -> [[f32; 4]; PHASES + 1] {
    let mut table = [[0.0; 4]; PHASES + 1];
    let mut k = 0;
    while k <= PHASES {
        let t = k as f32 / PHASES as f32;
        table[k] =
            [((-0.5 * t + 1.0) * t - 0.5) * t, (1.5 * t - 2.5) * t * t + 1.0, ((-1.5 * t + 2.0) * t + 0.5) * t, (0.5 * t - 0.5) * t * t];
        k += 1;
    }
    table
}

#[inline(always)]
fn weights(t: f32) -> &'static [f32; 4] {
    &CUBIC[(whole_number(t * PHASES as f32) as usize).min(PHASES)]
}

impl Grid {
    /// Splits the places of a row for a picture of a size of at least 2 × 2.
    pub(crate) fn set(&mut self, places: &Places, width: usize, height: usize) {
        let count = places.u.len();
        self.at.resize(count, 0);
        self.share_u.resize(count, 0.0);
        self.share_v.resize(count, 0.0);
        self.inside.resize(count, 0);
        let (w, h) = (width as f32, height as f32);
        let (last_u, last_v, stride) = (w - 1.0, h - 1.0, width as i32);
        let shares = self.share_u.iter_mut().zip(&mut self.share_v);
        let out = self.at.iter_mut().zip(shares).zip(&mut self.inside);
        for (((at, (share_u, share_v)), inside), (&u, &v)) in out.zip(places.u.iter().zip(&places.v)) {
            let held = (u > -0.5) & (v > -0.5) & (u < w - 0.5) & (v < h - 0.5);
            let whole = (u >= 1.0) & (v >= 1.0) & (u < w - 2.0) & (v < h - 2.0);
            // Within half a pixel of the border the border's own value stands.
            let (u, v) = (limited(u, last_u), limited(v, last_v));
            let (below_u, below_v) = (below(u, last_u), below(v, last_v));
            *at = (whole_number(below_v) * stride + whole_number(below_u)) as u32;
            *share_u = u - below_u;
            *share_v = v - below_v;
            *inside = held as u8 + whole as u8;
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
                let mut column = [0.0_f32; 4];
                let first = at - stride - 1;
                for (j, &wv) in wv.iter().enumerate() {
                    if let Some(row) = values[first + j * stride..].first_chunk::<4>() {
                        for i in 0..4 {
                            column[i] += wv * row[i];
                        }
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

    /// Two planes linear along both axes where `wanted` is not 0; the rest stays.
    pub(crate) fn linear_where(&self, wanted: &[u8], from: [&Plane<f32>; 2], out: [&mut [f32]; 2]) {
        let stride = from[0].width();
        let [out_a, out_b] = out;
        let places = self.at.iter().zip(&self.share_u).zip(&self.share_v);
        let all = wanted.iter().zip(out_a).zip(out_b).zip(places);
        for (((_, a), b), ((&at, &tu), &tv)) in all.filter(|(((wanted, _), _), _)| **wanted != 0) {
            *a = mix(from[0].values(), at as usize, stride, tu, tv);
            *b = mix(from[1].values(), at as usize, stride, tu, tv);
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
