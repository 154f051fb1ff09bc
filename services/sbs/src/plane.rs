//! One value a pixel.

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

    /// Makes this a picture of a size, all of one value, in the memory that it has.
    pub fn reset(&mut self, width: usize, height: usize, value: T) {
        self.width = width;
        self.height = height;
        self.data.clear();
        self.data.resize(width * height, value);
    }
}

impl Plane<f32> {
    /// The value between pixels, linear along both axes; outside, that of the nearest border pixel.
    #[must_use]
    #[inline]
    pub fn bilinear(&self, u: f32, v: f32) -> f32 {
        let u = u.clamp(0.0, (self.width - 1) as f32);
        let v = v.clamp(0.0, (self.height - 1) as f32);
        let (iu, iv) = ((u as usize).min(self.width.saturating_sub(2)), (v as usize).min(self.height.saturating_sub(2)));
        let (fu, fv) = (u - iu as f32, v - iv as f32);
        let at = iv * self.width + iu;
        let upper = &self.data[at..at + 2];
        let lower = &self.data[at + self.width..at + self.width + 2];
        let top = upper[0] + fu * (upper[1] - upper[0]);
        let bottom = lower[0] + fu * (lower[1] - lower[0]);
        top + fv * (bottom - top)
    }
}
