//! The soft shadows of walkers on the floor.

use super::column::Column;
use super::scene::crossing;
use super::view::{NEAREST_M, Sight, Spot, View};
use crate::geometry::Vector;

/// A round patch of less light, m.
#[derive(Debug, Clone, Copy)]
pub(super) struct Shadow {
    centre: Spot,
    radius_m: f32,
    /// Share of the light that is missing in its middle.
    depth: f32,
}

/// Where the body's shadow falls, from the body: the lamps do not hang straight above, m.
const BODY_ASIDE_M: [f64; 2] = [0.10, -0.07];

/// Adds the shadows of a walker's body and feet.
pub(super) fn shadows(view: &View, place: &Vector, feet: &[Vector; 2], shadows: &mut Vec<Shadow>) {
    let body = place + Vector::from(BODY_ASIDE_M);
    let patches = [(body, 0.52, 0.22), (feet[0], 0.24, 0.18), (feet[1], 0.24, 0.18)];
    let seen = patches.into_iter().map(|(centre, radius_m, depth)| Shadow { centre: view.spot(&centre), radius_m, depth });
    shadows.extend(seen.filter(|shadow| shadow.centre.ahead_m + shadow.radius_m > NEAREST_M));
}

impl Shadow {
    /// Darkens the floor that a column shows.
    pub(super) fn paint(&self, column: &mut Column, sight: &Sight) {
        let Some([near_m, far_m]) = crossing(self.centre, self.radius_m, sight.slope) else { return };
        if far_m <= NEAREST_M {
            return;
        }
        let rows = column.between(sight.row_px(0.0, far_m), sight.row_px(0.0, near_m.max(NEAREST_M)));
        for (_, row_px, pixel) in rows {
            let spot = sight.spot(sight.ahead_m(row_px, sight.height_m));
            let (x, y) = (spot.ahead_m - self.centre.ahead_m, spot.left_m - self.centre.left_m);
            let within = 1.0 - (x * x + y * y) / (self.radius_m * self.radius_m);
            if within > 0.0 {
                pixel.darken(self.depth * within * within);
            }
        }
    }
}
