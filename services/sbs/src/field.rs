//! The local field: one displacement a cell of the picture, for what T cannot explain (parallax).

/// Displacements at the centres of square cells, px; linear between them, constant beyond the outer ones.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Field {
    cell: usize,
    columns: usize,
    rows: usize,
    cells: Vec<[f32; 2]>,
}

impl Field {
    /// No displacement anywhere, for a picture of a size and cells of an edge of at least 1 px.
    #[must_use]
    pub fn zero(width: usize, height: usize, cell: usize) -> Self {
        let cell = cell.max(1);
        let (columns, rows) = (width.div_ceil(cell).max(1), height.div_ceil(cell).max(1));
        Self { cell, columns, rows, cells: vec![[0.0; 2]; columns * rows] }
    }

    /// Edge of a cell, px.
    #[must_use]
    pub fn cell(&self) -> usize {
        self.cell
    }

    /// Cells in a row.
    #[must_use]
    pub fn columns(&self) -> usize {
        self.columns
    }

    /// Rows of cells.
    #[must_use]
    pub fn rows(&self) -> usize {
        self.rows
    }

    /// The displacement of each cell, px, row by row.
    #[must_use]
    pub fn cells(&self) -> &[[f32; 2]] {
        &self.cells
    }

    /// The displacement of each cell, px, row by row.
    pub fn cells_mut(&mut self) -> &mut [[f32; 2]] {
        &mut self.cells
    }

    /// The centre of cell `k`, px.
    #[must_use]
    pub fn centre(&self, k: usize) -> [f64; 2] {
        let half = self.cell as f64 / 2.0 - 0.5;
        [(k % self.columns * self.cell) as f64 + half, (k / self.columns * self.cell) as f64 + half]
    }

    /// This field plus `factor` times another of the same shape.
    #[must_use]
    pub fn plus(&self, other: &Self, factor: f32) -> Self {
        let mut sum = self.clone();
        for (s, o) in sum.cells.iter_mut().zip(&other.cells) {
            *s = [s[0] + factor * o[0], s[1] + factor * o[1]];
        }
        sum
    }

    /// The same displacements in a picture `factor` times as large.
    #[must_use]
    pub fn scaled(&self, factor: usize) -> Self {
        let mut out = self.clone();
        out.cell *= factor;
        for c in &mut out.cells {
            *c = [c[0] * factor as f32, c[1] * factor as f32];
        }
        out
    }

    /// This field times a factor.
    #[must_use]
    pub fn times(&self, factor: f32) -> Self {
        let mut out = self.clone();
        for c in &mut out.cells {
            *c = [c[0] * factor, c[1] * factor];
        }
        out
    }

    /// The root mean square of the displacements, px.
    #[must_use]
    pub fn rms(&self) -> f32 {
        let sum: f32 = self.cells.iter().map(|c| c[0] * c[0] + c[1] * c[1]).sum();
        (sum / self.cells.len().max(1) as f32).sqrt()
    }

    /// Adds the displacement of each pixel of row `v` to the places given.
    #[inline(always)]
    pub fn add_row(&self, v: usize, places_u: &mut [f32], places_v: &mut [f32]) {
        let place = ((v as f32 + 0.5) / self.cell as f32 - 0.5).clamp(0.0, (self.rows - 1) as f32);
        let (upper, share) = (place as usize, place - place.floor());
        let lower = (upper + 1).min(self.rows - 1);
        let mix = |column: usize| {
            let (a, b) = (self.cells[upper * self.columns + column], self.cells[lower * self.columns + column]);
            [a[0] + share * (b[0] - a[0]), a[1] + share * (b[1] - a[1])]
        };
        // From the centre of one cell to that of the next the displacement is linear in u.
        let half = self.cell / 2;
        let per_pixel = 1.0 / self.cell as f32;
        let mut start = 0;
        let mut left = mix(0);
        for piece in 0..=self.columns {
            let right = mix(piece.min(self.columns - 1));
            let end = if piece == self.columns { places_u.len() } else { (piece * self.cell + half).min(places_u.len()) };
            let (slope_u, slope_v) = ((right[0] - left[0]) * per_pixel, (right[1] - left[1]) * per_pixel);
            // The centre of the piece's left cell lies half a pixel left of its first whole pixel.
            let first = if piece == 0 { 0.0 } else { start as f32 - (piece * self.cell - self.cell + half) as f32 + 0.5 };
            ramp(&mut places_u[start..end], left[0] + slope_u * first, slope_u);
            ramp(&mut places_v[start..end], left[1] + slope_v * first, slope_v);
            start = end;
            left = right;
        }
    }
}

/// Adds `from`, `from + slope`, … to the values, eight at a time: a cell has that many or a multiple.
#[inline(always)]
fn ramp(values: &mut [f32], from: f32, slope: f32) {
    const STEPS: [f32; 8] = [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0];
    let mut from = from;
    let (eights, rest) = values.as_chunks_mut::<8>();
    for eight in eights {
        for (value, step) in eight.iter_mut().zip(STEPS) {
            *value += from + slope * step;
        }
        from += 8.0 * slope;
    }
    for (value, step) in rest.iter_mut().zip(STEPS) {
        *value += from + slope * step;
    }
}
