//! A picture while it is painted, column by column.

use super::column::{Column, Pixel};
use super::decor;
use super::figure::Limb;
use super::materials::Materials;
use super::scene::{CEILING_M, Meeting, Visible};
use super::shadow::Shadow;
use super::view::{Sight, View};

/// A column in which something begins or ends is painted as so many narrow ones.
const SLICES: u32 = 4;

/// Everything that one picture shows, and the columns painted so far.
#[derive(Debug, Clone, Default)]
pub(super) struct Canvas {
    pub(super) visible: Visible,
    /// The farthest first.
    pub(super) limbs: Vec<Limb>,
    pub(super) shadows: Vec<Shadow>,
    column: Column,
    slice: Column,
    planes: Column,
    met: Vec<Meeting>,
    left: Vec<Meeting>,
    right: Vec<Meeting>,
    /// The pixels column by column.
    pixels: Vec<Pixel>,
}

impl Canvas {
    /// Paints all columns; the pixels come column by column.
    pub(super) fn paint(&mut self, view: &View, materials: &Materials, size_px: [u32; 2]) -> &[Pixel] {
        let [width, height] = size_px;
        self.limbs.sort_by(|a, b| b.ahead_m.total_cmp(&a.ahead_m));
        self.pixels.clear();
        let mut column = std::mem::take(&mut self.column);
        column.pixels.resize(height as usize, Pixel::default());
        self.look(view, 0.0);
        std::mem::swap(&mut self.left, &mut self.met);
        for number in 0..width {
            let left_px = number as f32;
            self.look(view, left_px + 1.0);
            std::mem::swap(&mut self.right, &mut self.met);
            if same(&self.left, &self.right) {
                let sight = view.sight(left_px + 0.5, 1.0);
                self.look(view, sight.column_px);
                let hides = self.met.last().filter(|meeting| meeting.look.is_full());
                paint_planes(view, &sight, hides.map(|meeting| meeting.ahead_m), materials, &mut column);
                self.paint_things(&sight, materials, &mut column);
            } else {
                self.paint_slices(view, left_px, materials, &mut column);
            }
            self.pixels.extend_from_slice(&column.pixels);
            std::mem::swap(&mut self.left, &mut self.right);
        }
        self.column = column;
        &self.pixels
    }

    /// What stands where a column looks.
    fn look(&mut self, view: &View, column_px: f32) {
        let sight = view.sight(column_px, 1.0);
        self.visible.met_by(column_px, sight.slope, view.focal_px, &mut self.met);
    }

    fn paint_slices(&mut self, view: &View, left_px: f32, materials: &Materials, column: &mut Column) {
        let width_px = 1.0 / SLICES as f32;
        let mut planes = std::mem::take(&mut self.planes);
        let mut slice = std::mem::take(&mut self.slice);
        planes.pixels.resize(column.pixels.len(), Pixel::default());
        // Floor and ceiling are the same for all slices, and seen as far as any of them sees.
        paint_planes(view, &view.sight(left_px + 0.5, 1.0), None, materials, &mut planes);
        column.pixels.fill(Pixel::default());
        for number in 0..SLICES {
            let sight = view.sight(left_px + (number as f32 + 0.5) * width_px, width_px);
            slice.pixels.clone_from(&planes.pixels);
            self.look(view, sight.column_px);
            self.paint_things(&sight, materials, &mut slice);
            column.pixels.iter_mut().zip(&slice.pixels).for_each(|(pixel, part)| pixel.add(width_px, part));
        }
        (self.planes, self.slice) = (planes, slice);
    }

    /// Shadows, what stands and who walks, from what is far to what is near.
    fn paint_things(&self, sight: &Sight, materials: &Materials, column: &mut Column) {
        for shadow in &self.shadows {
            shadow.paint(column, sight);
        }
        let mut limbs =
            self.limbs.iter().filter(|limb| sight.column_px + 0.5 >= limb.columns_px[0] && sight.column_px - 0.5 <= limb.columns_px[1]);
        let mut limb = limbs.next();
        for (index, meeting) in self.met.iter().enumerate().rev() {
            while let Some(farther) = limb.filter(|limb| limb.ahead_m > meeting.ahead_m) {
                farther.paint(column, sight, &materials.cloth);
                limb = limbs.next();
            }
            let nearer = self.met.get(..index).unwrap_or_default();
            match meeting.near_side_m(nearer) {
                None => decor::paint(column, sight, meeting, materials),
                Some(near_m) => decor::paint_top(column, sight, meeting, near_m),
            }
        }
        limb.into_iter().chain(limbs).for_each(|limb| limb.paint(column, sight, &materials.cloth));
    }
}

/// Floor and ceiling up to whatever hides the rest.
fn paint_planes(view: &View, sight: &Sight, hidden_m: Option<f32>, materials: &Materials, column: &mut Column) {
    column.pixels.fill(Pixel::default());
    let row_px = |height_m: f32| hidden_m.map_or(sight.horizon_px, |ahead_m| sight.row_px(height_m, ahead_m));
    let planes = [
        (0.0, row_px(CEILING_M), &materials.ceiling, sight.height_m - CEILING_M),
        (row_px(0.0), f32::INFINITY, &materials.floor, sight.height_m),
    ];
    for (top_px, bottom_px, texture, below_m) in planes {
        for (_, row_px, pixel) in column.between(top_px, bottom_px) {
            let ahead_m = sight.ahead_m(row_px, below_m);
            let (x_m, y_m) = view.place(sight.spot(ahead_m));
            // A pixel shows a stretch of floor that is far longer than wide: between the two, as for walls.
            let wide_m = ahead_m / sight.focal_px;
            let long_m = wide_m * ahead_m / below_m.abs().max(0.01);
            pixel.grey = texture.at(x_m, y_m, (wide_m * long_m).sqrt().max(long_m / 4.0));
        }
    }
}

/// Whether two columns meet the same things.
fn same(left: &[Meeting], right: &[Meeting]) -> bool {
    left.len() == right.len() && left.iter().zip(right).all(|(left, right)| left.is_of(right))
}
