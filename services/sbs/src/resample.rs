//! Values between pixels for a row of places: Catmull–Rom for means, linear for variances, nearest for the rest.

use wide::f32x4;

use crate::motion::Places;
use crate::plane::{Plane, mix};
use crate::rounding::{below, limited, whole_number};

/// Pixels that are done at a time.
const LANES: usize = 8;

/// One row's places, split into a whole pixel and a share of the way to the next.
#[derive(Debug, Default)]
pub(crate) struct Grid {
    /// Pixel at or left of and above the place; meaningless where `inside` is 0.
    at: Vec<u32>,
    share_u: Vec<f32>,
    share_v: Vec<f32>,
    /// Pixel nearest to the place.
    near: Vec<u32>,
    /// 0: not in the picture; more: see the constants below.
    inside: Vec<u8>,
    /// How many of an eight of places lie one pixel after the other from its first one, when the others do so up to its last one
    /// and all have the 4 × 4 pixels around them in the picture; 0 for other eights. Most are read at once, or twice and put together.
    straight: Vec<usize>,
    /// Whether the pixels nearest to an eight of places follow one by one.
    steady: Vec<bool>,
}

/// An eight of places that can be read at once: a pixel, from which the first few places follow one by one, one for the others.
struct Eight {
    from: [usize; 2],
    first: usize,
    share_u: [f32; LANES],
    share_v: [f32; LANES],
}

/// The place lies between pixels of the picture; below this and above 0, within half a pixel of its border, whose value stands there.
pub(crate) const BETWEEN: u8 = 2;
/// The 4 × 4 pixels around the place are in the picture.
const WHOLE: u8 = 3;

/// Cubic weights of the four neighbours of places a share t of the way from the second to the third (Catmull–Rom).
#[inline(always)]
fn weights(t: f32) -> [f32; 4] {
    [((t * -0.5 + 1.0) * t - 0.5) * t, (t * 1.5 - 2.5) * t * t + 1.0, ((t * -1.5 + 2.0) * t + 0.5) * t, (t * 0.5 - 0.5) * t * t]
}

/// The same four weights for one place.
#[inline(always)]
fn weights_of_one(t: f32) -> f32x4 {
    const POWERS: [[f32; 4]; 4] = [[0.0, 1.0, 0.0, 0.0], [-0.5, 0.0, 0.5, 0.0], [1.0, -2.5, 2.0, -0.5], [-0.5, 1.5, -1.5, 0.5]];
    let [one, t1, t2, t3] = POWERS.map(f32x4::new);
    ((t3 * t + t2) * t + t1) * t + one
}

impl Grid {
    /// Splits the places of a row for a picture of a size of at least 2 × 2.
    #[inline(always)]
    pub(crate) fn set(&mut self, places: &Places, width: usize, height: usize) {
        self.set_scattered(places, width, height);
        self.find_straight(width, width * height);
    }

    /// The same for places that do not follow each other.
    #[inline(always)]
    pub(crate) fn set_scattered(&mut self, places: &Places, width: usize, height: usize) {
        let count = places.u.len();
        self.at.resize(count, 0);
        self.share_u.resize(count, 0.0);
        self.share_v.resize(count, 0.0);
        self.near.resize(count, 0);
        self.inside.resize(count, 0);
        self.straight.clear();
        self.steady.clear();
        let (w, h) = (width as f32, height as f32);
        let (last_u, last_v, stride) = (w - 1.0, h - 1.0, width as i32);
        let shares = self.share_u.iter_mut().zip(&mut self.share_v);
        let out = self.at.iter_mut().zip(&mut self.near).zip(shares).zip(&mut self.inside);
        for ((((at, near), (share_u, share_v)), inside), (&u, &v)) in out.zip(places.u.iter().zip(&places.v)) {
            let in_picture = (u > -0.5) & (v > -0.5) & (u < w - 0.5) & (v < h - 0.5);
            let between = (u >= 0.0) & (v >= 0.0) & (u <= last_u) & (v <= last_v);
            // The pixel at or left of and above a place at 1 exactly may be 0, which has no neighbour before it.
            let is_surrounded = (u > 1.0) & (v > 1.0) & (u < w - 2.0) & (v < h - 2.0);
            let (u, v) = (limited(u, last_u), limited(v, last_v));
            let (below_u, below_v) = (below(u, last_u), below(v, last_v));
            *at = (whole_number(below_v) * stride + whole_number(below_u)) as u32;
            *share_u = u - below_u;
            *share_v = v - below_v;
            *near = *at + u32::from(*share_u >= 0.5) + if *share_v >= 0.5 { stride as u32 } else { 0 };
            *inside = in_picture as u8 + between as u8 + is_surrounded as u8;
        }
    }

    #[inline(always)]
    fn find_straight(&mut self, stride: usize, pixels: usize) {
        self.straight.resize(self.at.len() / LANES, 0);
        self.steady.resize(self.at.len() / LANES, false);
        let eights = self.at.as_chunks::<LANES>().0.iter().zip(self.inside.as_chunks::<LANES>().0).zip(self.near.as_chunks::<LANES>().0);
        for ((straight, steady), ((at, inside), near)) in self.straight.iter_mut().zip(&mut self.steady).zip(eights) {
            *steady = in_turn(near, near[0]) == u8::MAX;
            let (from, to) = (at[0], at[LANES - 1].wrapping_sub(LANES as u32 - 1));
            let (first, last) = (in_turn(at, from), in_turn(at, to));
            let count = first.trailing_ones();
            let all = count == LANES as u32 || last >> count == u8::MAX >> count;
            // The neighbours of all eight pixels are read, though some of them count only from one of the two.
            let (low, high) = (from.min(to) as usize, from.max(to) as usize);
            let within = low > stride && high + 2 * stride + 2 + LANES < pixels;
            *straight = if all && within && *inside == [WHOLE; LANES] { count as usize } else { 0 };
        }
    }

    /// How far inside the picture each place is.
    pub(crate) fn inside(&self) -> &[u8] {
        &self.inside
    }

    /// Catmull–Rom where all sixteen neighbours are in the picture, linear at its border.
    #[inline(always)]
    pub(crate) fn cubic(&self, from: &Plane<f32>, out: &mut [f32]) {
        let (stride, values) = (from.width(), from.values());
        let (eights, rest) = out.as_chunks_mut::<LANES>();
        let done = eights.len() * LANES;
        for (i, o) in rest.iter_mut().enumerate() {
            *o = self.cubic_at(done + i, values, stride);
        }
        for (n, eight) in eights.iter_mut().enumerate() {
            let Some(places) = self.straight_eight(n) else {
                for (i, o) in eight.iter_mut().enumerate() {
                    *o = self.cubic_at(n * LANES + i, values, stride);
                }
                continue;
            };
            *eight = cubic_eight(values, places.from[0], stride, &places.share_u, &places.share_v).unwrap_or_default();
            if places.first < LANES {
                put_behind(
                    places.first,
                    cubic_eight(values, places.from[1], stride, &places.share_u, &places.share_v).unwrap_or_default(),
                    eight,
                );
            }
        }
    }

    #[inline(always)]
    fn cubic_at(&self, k: usize, values: &[f32], stride: usize) -> f32 {
        let (at, share_u, share_v) = (self.at[k] as usize, self.share_u[k], self.share_v[k]);
        if self.inside[k] < WHOLE {
            return mix(values, at, stride, share_u, share_v);
        }
        let along_v = weights_of_one(share_v).to_array();
        let block = &values[at - stride - 1..][..3 * stride + 4];
        let row =
            |n: usize| f32x4::new([block[n * stride], block[n * stride + 1], block[n * stride + 2], block[n * stride + 3]]) * along_v[n];
        let products = (((row(0) + row(2)) + (row(1) + row(3))) * weights_of_one(share_u)).to_array();
        (products[0] + products[2]) + (products[1] + products[3])
    }

    /// Linear along both axes.
    #[inline(always)]
    pub(crate) fn linear(&self, from: &Plane<f32>, out: &mut [f32]) {
        let (stride, values) = (from.width(), from.values());
        let (eights, rest) = out.as_chunks_mut::<LANES>();
        let done = eights.len() * LANES;
        for (i, o) in rest.iter_mut().enumerate() {
            *o = self.linear_at(done + i, values, stride);
        }
        for (n, eight) in eights.iter_mut().enumerate() {
            let Some(places) = self.straight_eight(n) else {
                for (i, o) in eight.iter_mut().enumerate() {
                    *o = self.linear_at(n * LANES + i, values, stride);
                }
                continue;
            };
            *eight = linear_eight(values, places.from[0], stride, &places.share_u, &places.share_v);
            if places.first < LANES {
                put_behind(places.first, linear_eight(values, places.from[1], stride, &places.share_u, &places.share_v), eight);
            }
        }
    }

    #[inline(always)]
    fn linear_at(&self, k: usize, values: &[f32], stride: usize) -> f32 {
        mix(values, self.at[k] as usize, stride, self.share_u[k], self.share_v[k])
    }

    /// The value of the nearest pixel.
    #[inline(always)]
    pub(crate) fn nearest<T: Copy>(&self, from: &Plane<T>, out: &mut [T]) {
        let values = from.values();
        let ((eights, rest), (near, last)) = (out.as_chunks_mut::<LANES>(), self.near.as_chunks::<LANES>());
        for ((eight, near), steady) in eights.iter_mut().zip(near).zip(&self.steady) {
            let first = near[0] as usize;
            match values.get(first..).and_then(|values| values.first_chunk()) {
                Some(values) if *steady => *eight = *values,
                _ => eight.iter_mut().zip(near).for_each(|(o, near)| *o = values[*near as usize]),
            }
        }
        rest.iter_mut().zip(last).for_each(|(o, near)| *o = values[*near as usize]);
    }

    /// Eight number `n`, if it can be read at once.
    #[inline(always)]
    fn straight_eight(&self, n: usize) -> Option<Eight> {
        let at = n * LANES;
        let first = *self.straight.get(n).filter(|straight| **straight > 0)?;
        let from = [self.at[at] as usize, self.at[at + LANES - 1] as usize + 1 - LANES];
        Some(Eight { from, first, share_u: *self.share_u[at..].first_chunk()?, share_v: *self.share_v[at..].first_chunk()? })
    }
}

/// Which of eight pixels are the first, second … from a pixel on, the first one in the lowest bit.
#[inline(always)]
fn in_turn(pixels: &[u32; LANES], from: u32) -> u8 {
    let mut bits = 0;
    for (i, pixel) in pixels.iter().enumerate() {
        bits |= u8::from(*pixel == from.wrapping_add(i as u32)) << i;
    }
    bits
}

/// Catmull–Rom for eight places that follow one by one from a pixel.
#[inline(always)]
fn cubic_eight(values: &[f32], at: usize, stride: usize, share_u: &[f32; LANES], share_v: &[f32; LANES]) -> Option<[f32; LANES]> {
    let row = |n: usize| values.get(at - stride - 1 + n * stride..)?.first_chunk::<{ LANES + 3 }>();
    let (a, b, c, d) = (row(0)?, row(1)?, row(2)?, row(3)?);
    let mut eight = [0.0; LANES];
    for i in 0..LANES {
        let (wu, wv) = (weights(share_u[i]), weights(share_v[i]));
        let along = |row: &[f32; LANES + 3]| (wu[0] * row[i] + wu[2] * row[i + 2]) + (wu[1] * row[i + 1] + wu[3] * row[i + 3]);
        eight[i] = (wv[0] * along(a) + wv[2] * along(c)) + (wv[1] * along(b) + wv[3] * along(d));
    }
    Some(eight)
}

/// The same, linear along both axes.
#[inline(always)]
fn linear_eight(values: &[f32], at: usize, stride: usize, share_u: &[f32; LANES], share_v: &[f32; LANES]) -> [f32; LANES] {
    let block = &values[at..][..stride + LANES + 1];
    let (upper, lower) = (&block[..LANES + 1], &block[stride..][..LANES + 1]);
    let mut eight = [0.0; LANES];
    for first in [0, 4] {
        let share_u = lanes(share_u, first);
        let top = lanes(upper, first) + share_u * (lanes(upper, first + 1) - lanes(upper, first));
        let bottom = lanes(lower, first) + share_u * (lanes(lower, first + 1) - lanes(lower, first));
        eight[first..first + 4].copy_from_slice(&(top + lanes(share_v, first) * (bottom - top)).to_array());
    }
    eight
}

/// Keeps the first few values of an eight and takes the others from another.
#[inline(always)]
fn put_behind(first: usize, other: [f32; LANES], eight: &mut [f32; LANES]) {
    for (i, (value, other)) in eight.iter_mut().zip(other).enumerate() {
        *value = if i < first { *value } else { other };
    }
}

/// Four values from a place on, which must be there.
#[inline(always)]
fn lanes(values: &[f32], from: usize) -> f32x4 {
    let mut four = [0.0; 4];
    four.copy_from_slice(&values[from..from + 4]);
    f32x4::new(four)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A picture of 16 × 9 and its values at places in a row: those of its pixels.
    fn check(u: [f32; LANES + 1], v: f32) {
        let picture = Plane::from_values(16, 9, (0..16 * 9).map(|at| (at * 37 % 101) as f32).collect()).unwrap();
        let mut grid = Grid::default();
        grid.set(&Places { u: u.to_vec(), v: vec![v; u.len()] }, 16, 9);
        let (mut cubic, mut linear) = (vec![0.0; u.len()], vec![0.0; u.len()]);
        grid.cubic(&picture, &mut cubic);
        grid.linear(&picture, &mut linear);
        for (k, u) in u.into_iter().enumerate() {
            let expected = picture.row(v as usize)[u as usize];
            assert!(
                (cubic[k] - expected).abs() < 1e-3 && (linear[k] - expected).abs() < 1e-3,
                "{u}, {v}: {expected}, {cubic:?}, {linear:?}"
            );
        }
    }

    #[test]
    fn places_on_pixels_have_their_values() {
        for v in 0..9 {
            let row = |first: usize| std::array::from_fn(|k| (first + k) as f32);
            for first in 0..16 - LANES {
                check(row(first), v as f32);
            }
            // Places that do not follow each other, the second pixel among them.
            check([1.0, 3.0, 2.0, 1.0, 14.0, 0.0, 15.0, 7.0, 1.0], v as f32);
        }
    }
}
