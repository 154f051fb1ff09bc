//! One value a pixel.

use crate::rounding::{below, limited, whole_number};

/// A picture of one value a pixel, row by row from the top.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Plane<T> {
    width: usize,
    height: usize,
    data: Vec<T>,
}

impl<T: Copy> Plane<T> {
    /// The same value everywhere.
    #[must_use]
    pub fn filled(width: usize, height: usize, value: T) -> Self {
        Self { width, height, data: vec![value; width * height] }
    }

    /// A picture of given values; `None` when their number is not width × height.
    #[must_use]
    pub fn from_values(width: usize, height: usize, data: Vec<T>) -> Option<Self> {
        (width.checked_mul(height)? == data.len()).then_some(Self { width, height, data })
    }

    /// Columns.
    #[must_use]
    pub fn width(&self) -> usize {
        self.width
    }

    /// Rows.
    #[must_use]
    pub fn height(&self) -> usize {
        self.height
    }

    /// All values, row by row.
    #[must_use]
    pub fn values(&self) -> &[T] {
        &self.data
    }

    /// All values, row by row.
    pub fn values_mut(&mut self) -> &mut [T] {
        &mut self.data
    }

    /// A row; empty below the picture.
    #[must_use]
    pub fn row(&self, v: usize) -> &[T] {
        self.data.get(v * self.width..(v + 1) * self.width).unwrap_or(&[])
    }

    /// A row; empty below the picture.
    pub fn row_mut(&mut self, v: usize) -> &mut [T] {
        self.data.get_mut(v * self.width..(v + 1) * self.width).unwrap_or(&mut [])
    }

    /// The value of a pixel, the nearest one of the picture for a place outside. The picture must not be empty.
    #[must_use]
    pub fn nearest(&self, u: isize, v: isize) -> T {
        let u = u.clamp(0, self.width as isize - 1) as usize;
        let v = v.clamp(0, self.height as isize - 1) as usize;
        self.data[v * self.width + u]
    }

    /// Makes this a picture of a size in the memory that it has. What has that size already keeps its values; new ones are as given.
    pub fn reshape(&mut self, width: usize, height: usize, value: T) {
        if (self.width, self.height) != (width, height) {
            *self = Self::filled(width, height, value);
        }
    }
}

impl Plane<f32> {
    /// The value between pixels, linear along both axes; outside, that of the nearest border pixel. The picture is at least 2 × 2.
    #[must_use]
    #[inline]
    pub fn bilinear(&self, u: f32, v: f32) -> f32 {
        self.bilinear_inside(limited(u, (self.width - 1) as f32), limited(v, (self.height - 1) as f32))
    }

    /// The same for a place from 0 to the last column and row.
    #[must_use]
    #[inline(always)]
    pub(crate) fn bilinear_inside(&self, u: f32, v: f32) -> f32 {
        let (below_u, below_v) = (below(u, (self.width - 1) as f32), below(v, (self.height - 1) as f32));
        let at = whole_number(below_v) as usize * self.width + whole_number(below_u) as usize;
        mix(&self.data, at, self.width, u - below_u, v - below_v)
    }
}

/// Linear along both axes between the pixel at `at`, its right and its lower neighbours.
#[inline(always)]
pub(crate) fn mix(values: &[f32], at: usize, stride: usize, share_u: f32, share_v: f32) -> f32 {
    let block = &values[at..at + stride + 2];
    let top = block[0] + share_u * (block[1] - block[0]);
    let bottom = block[stride] + share_u * (block[stride + 1] - block[stride]);
    top + share_v * (bottom - top)
}
