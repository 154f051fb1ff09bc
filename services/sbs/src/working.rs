//! The size that SBS works at.
//!
//! A picture from 320 wide on is halved first: the means of 2 × 2 pixels carry half the noise, and a moving person is as large
//! as ever. (F1 driving at 320 × 240 is .857 so, .846 at full size, for a third of the time.) What goes out is in pixels of
//! the camera again.

use crate::components::Component;
use crate::model::SET;
use crate::plane::Plane;
use crate::pyramid::halve;
use crate::transform::Transform;

/// From this width on a picture is halved.
const HALVED_FROM: usize = 320;

/// Size of the camera's pictures and how it relates to the working size.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Working {
    /// Of the camera's picture, px.
    pub(crate) width: usize,
    /// Of the camera's picture, px.
    pub(crate) height: usize,
    /// Camera pixels along the edge of a working pixel.
    pub(crate) factor: usize,
}

impl Working {
    pub(crate) fn new(width: usize, height: usize) -> Self {
        Self { width, height, factor: if width < HALVED_FROM { 1 } else { 2 } }
    }

    /// Width and height of a working picture.
    pub(crate) fn size(&self) -> (usize, usize) {
        (self.width / self.factor, self.height / self.factor)
    }

    /// A camera's picture at working size.
    pub(crate) fn reduced(&self, picture: Plane<f32>) -> Plane<f32> {
        if self.factor == 1 {
            return picture;
        }
        let mut small = Plane::default();
        halve(&picture, &mut small);
        small
    }

    /// A working mask at the camera's size.
    ///
    /// Each of a working pixel's quarters is set when most of the three working pixels next to that corner and the pixel itself,
    /// which counts twice, are: edges come out smooth.
    pub(crate) fn mask(&self, mask: &Plane<u8>) -> Plane<u8> {
        if self.factor == 1 {
            return mask.clone();
        }
        let mut out = Plane::filled(self.width, self.height, 0_u8);
        for v in 0..self.height {
            let (row, toward_v) = ((v / 2).min(mask.height() - 1) as isize, if v % 2 == 0 { -1 } else { 1 });
            for (u, o) in out.row_mut(v).iter_mut().enumerate() {
                let (column, toward_u) = ((u / 2).min(mask.width() - 1) as isize, if u % 2 == 0 { -1 } else { 1 });
                let at = |du: isize, dv: isize| u32::from(mask.nearest(column + du, row + dv) & 1);
                let votes = 2 * at(0, 0) + at(toward_u, 0) + at(0, toward_v) + at(toward_u, toward_v);
                *o = if votes >= 3 { SET } else { 0 };
            }
        }
        out
    }

    /// A working picture at the camera's size, as bytes.
    pub(crate) fn picture(&self, picture: &Plane<f32>) -> Plane<u8> {
        let byte = |z: f32| (z + 0.5) as u8;
        let mut out = Plane::filled(self.width, self.height, 0_u8);
        let factor = self.factor as f32;
        for v in 0..self.height {
            let place_v = (v as f32 + 0.5) / factor - 0.5;
            for (u, o) in out.row_mut(v).iter_mut().enumerate() {
                *o = byte(picture.bilinear((u as f32 + 0.5) / factor - 0.5, place_v));
            }
        }
        out
    }

    /// A working component in the camera's pixels.
    pub(crate) fn component(&self, c: &Component) -> Component {
        let f = self.factor as u32;
        let (size, shift) = (c.size * f * f, u64::from(c.size) * u64::from(f * f) * u64::from(f - 1) / 2);
        Component {
            size,
            sum_u: c.sum_u * u64::from(f * f * f) + shift,
            sum_v: c.sum_v * u64::from(f * f * f) + shift,
            left: c.left * f,
            top: c.top * f,
            right: c.right * f,
            bottom: c.bottom * f,
        }
    }

    /// A transform of working pixels in the camera's.
    pub(crate) fn transform(&self, transform: &Transform) -> Transform {
        transform.scaled(self.factor as f64).unwrap_or(*transform)
    }
}
