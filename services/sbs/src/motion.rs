//! The way from the current frame to the background frame: T and the local field.

use crate::field::Field;
use crate::transform::Transform;

/// Where each pixel of the current frame lies in the background frame: `T x + field(x)`.
#[derive(Debug, Clone, PartialEq)]
pub struct Motion {
    /// T of section 5.1 of the paper.
    pub transform: Transform,
    /// What T cannot explain.
    pub field: Field,
}

/// Places of one row of pixels, reused from row to row.
#[derive(Debug, Clone, Default)]
pub struct Places {
    /// Columns in the background frame, px.
    pub u: Vec<f32>,
    /// Rows in the background frame, px.
    pub v: Vec<f32>,
}

impl Places {
    /// Where a transform, row by row, puts these places.
    #[inline(always)]
    pub(crate) fn transformed(&self, m: &[f32; 9], out: &mut Self) {
        out.u.resize(self.u.len(), 0.0);
        out.v.resize(self.v.len(), 0.0);
        for ((out_u, out_v), (&u, &v)) in out.u.iter_mut().zip(&mut out.v).zip(self.u.iter().zip(&self.v)) {
            let scale = 1.0 / (m[6] * u + m[7] * v + m[8]);
            *out_u = (m[0] * u + m[1] * v + m[2]) * scale;
            *out_v = (m[3] * u + m[4] * v + m[5]) * scale;
        }
    }
}

impl Motion {
    /// The same motion in a picture `factor` times as large; `None` when T is degenerate.
    #[must_use]
    pub fn scaled(&self, factor: usize) -> Option<Self> {
        if factor == 1 {
            return Some(self.clone());
        }
        Some(Self { transform: self.transform.scaled(factor as f64)?, field: self.field.scaled(factor) })
    }

    /// The whole displacement at the centres of the field's cells.
    #[must_use]
    pub fn displacement(&self) -> Field {
        let mut whole = self.field.clone();
        for k in 0..whole.cells().len() {
            let centre = whole.centre(k);
            let [u, v] = self.transform.apply(centre);
            let c = &mut whole.cells_mut()[k];
            *c = [c[0] + (u - centre[0]) as f32, c[1] + (v - centre[1]) as f32];
        }
        whole
    }

    /// The places of the pixels of row `v` of a picture of a width.
    #[inline(always)]
    pub fn places(&self, v: usize, width: usize, places: &mut Places) {
        places.u.clear();
        places.v.clear();
        let m = self.transform.rows().map(|x| x as f32);
        let v_f = v as f32;
        let (u_0, v_0, w_0) = (m[1] * v_f + m[2], m[4] * v_f + m[5], m[7] * v_f + m[8]);
        if self.transform.is_affine() {
            places.u.extend((0..width as i32).map(|u| m[0] * u as f32 + u_0));
            places.v.extend((0..width as i32).map(|u| m[3] * u as f32 + v_0));
        } else {
            places.u.extend((0..width as i32).map(|u| (m[0] * u as f32 + u_0) / (m[6] * u as f32 + w_0)));
            places.v.extend((0..width as i32).map(|u| (m[3] * u as f32 + v_0) / (m[6] * u as f32 + w_0)));
        }
        self.field.add_row(v, &mut places.u, &mut places.v);
    }
}
