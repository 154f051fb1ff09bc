//! A walker's figure: head, trunk, arms and legs, each a rounded piece between two places.

use super::column::Column;
use super::lattice::{floored, mixed, share};
use super::texture::Texture;
use super::view::{NEAREST_M, Sight, Spot, View};
use crate::geometry::Vector;
use crate::walker::{HALF_STANCE_M, Stance};

/// Nearer than this a limb is cut off, m: what is closer fills the picture.
const CUT_M: f32 = 3.0 * NEAREST_M;

/// How high a foot is lifted in the middle of a step, m.
const LIFT_M: f32 = 0.06;

/// Width of a stripe, m.
const STRIPE_M: f32 = 0.06;

/// Clothes of a walker.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Clothes {
    shirt: Cloth,
    trousers: Cloth,
    shoes: Cloth,
    skin: Cloth,
    hair: Cloth,
}

/// A cloth, or what is worn instead.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Cloth {
    grey: f32,
    /// How much of the weave's contrast it has.
    rough: f32,
    /// How much darker its stripes are.
    stripes: f32,
    /// Where in the weave it was cut, m.
    cut_m: f32,
}

impl Clothes {
    /// What the walker of this number wears.
    pub(super) fn of(seed: u32, number: usize) -> Self {
        let seed = mixed(seed, number as i32, 77);
        let choice = |greys: &[f32], purpose: i32| {
            let index = (share(seed, 0, purpose) * greys.len() as f32) as usize;
            greys.get(index).copied().unwrap_or(80.0)
        };
        let cloth = |grey, rough, stripes| Cloth { grey, rough, stripes, cut_m: share(seed, 1, grey as i32) * 2.56 };
        // Few wear the grey of the walls: they cannot be told from them.
        let shirt = choice(&[48.0, 66.0, 84.0, 118.0, 196.0, 222.0], 1);
        let striped = share(seed, 0, 2) < 0.35;
        Self {
            shirt: cloth(shirt, 1.0, if striped { 0.4 } else { 0.0 }),
            trousers: cloth(choice(&[38.0, 50.0, 62.0, 76.0, 90.0], 3), 1.0, 0.0),
            shoes: cloth(choice(&[24.0, 34.0, 60.0], 4), 0.2, 0.0),
            skin: cloth(choice(&[112.0, 142.0, 176.0], 5), 0.2, 0.0),
            hair: cloth(choice(&[28.0, 52.0, 88.0], 6), 0.7, 0.0),
        }
    }
}

/// A rounded piece in the world: two places, how high they are and how thick it is there, m.
#[derive(Debug, Clone, Copy)]
struct Piece {
    ends: [(Vector, f32); 2],
    radii_m: [f32; 2],
    cloth: Cloth,
}

/// A piece in the picture, px.
#[derive(Debug, Clone, Copy)]
pub(super) struct Limb {
    /// Its distance, m.
    pub(super) ahead_m: f32,
    /// The columns it is in.
    pub(super) columns_px: [f32; 2],
    from: [f32; 2],
    across: [f32; 2],
    length_squared: f32,
    radii: [f32; 2],
    /// Heights of the ends, m.
    heights_m: [f32; 2],
    /// Size of a pixel there, m.
    pixel_m: f32,
    cloth: Cloth,
}

/// Adds a walker's limbs before the lens.
pub(super) fn limbs(view: &View, stance: &Stance, clothes: &Clothes, limbs: &mut Vec<Limb>) {
    limbs.extend(pieces(stance, clothes).iter().filter_map(|piece| piece.seen_by(view)));
}

/// The pieces of a body of 1.7 m, scaled to the size of the walker.
fn pieces(stance: &Stance, clothes: &Clothes) -> Vec<Piece> {
    let (scale, scale_f32) = (stance.scale, stance.scale as f32);
    let stance = Stance { stride_m: stance.stride_m / scale, reach_m: stance.reach_m / scale, ..*stance };
    let left = Vector::new(-stance.ahead.y, stance.ahead.x);
    let at = |ahead_m: f64, left_m: f64| stance.place + stance.ahead * (ahead_m * scale) + left * (left_m * scale);
    let piece = |from: (Vector, f32), to: (Vector, f32), radii_m: [f32; 2], cloth: Cloth| Piece {
        ends: [from, to].map(|(place, height_m)| (place, height_m * scale_f32)),
        radii_m: radii_m.map(|radius_m| radius_m * scale_f32),
        cloth,
    };
    let mut pieces = Vec::with_capacity(24);
    let full_stride = if stance.reach_m > 0.0 { stance.stride_m / stance.reach_m } else { 0.0 };
    for (side, swings) in [(1.0, stance.left_swings), (-1.0, !stance.left_swings)] {
        let aside_m = side * HALF_STANCE_M;
        let foot_m = side * stance.stride_m;
        // A foot is lifted only as far as it goes.
        let lifted = if swings { (1.0 - full_stride * full_stride) * (stance.reach_m * 5.0).min(1.0) } else { 0.0 };
        let lift_m = LIFT_M * lifted as f32;
        let knee = (at(foot_m / 2.0 + 0.03 + 0.14 * lifted, aside_m), 0.50 + lift_m / 2.0);
        let (hip, ankle) = ((at(0.0, aside_m), 0.90), (at(foot_m - 0.02, aside_m), 0.10 + lift_m));
        pieces.push(piece(hip, knee, [0.095, 0.075], clothes.trousers));
        pieces.push(piece(knee, ankle, [0.075, 0.06], clothes.trousers));
        let (heel, toe) = ((at(foot_m - 0.06, aside_m), 0.045 + lift_m), (at(foot_m + 0.10, aside_m), 0.04 + lift_m));
        pieces.push(piece(heel, toe, [0.045, 0.04], clothes.shoes));
        // An arm swings with the other side's leg.
        let swing_m = -side * 0.26 * stance.stride_m / 0.3;
        let (shoulder, elbow) = ((at(0.0, side * 0.18), 1.40), (at(swing_m * 0.4, side * 0.225), 1.13));
        let hand = (at(swing_m + 0.05, side * 0.21), 0.90);
        pieces.push(piece(shoulder, elbow, [0.055, 0.048], clothes.shirt));
        pieces.push(piece(elbow, hand, [0.048, 0.04], clothes.shirt));
        pieces.push(piece(hand, (hand.0, hand.1 - 0.05), [0.042, 0.04], clothes.skin));
        pieces.push(piece((at(0.0, side * 0.06), 0.95), (at(0.0, side * 0.10), 1.40), [0.105, 0.105], clothes.shirt));
    }
    let middle = |height_m: f32| (at(0.0, 0.0), height_m);
    pieces.push(piece(middle(0.93), middle(1.38), [0.12, 0.125], clothes.shirt));
    pieces.push(piece(middle(1.44), middle(1.54), [0.055, 0.055], clothes.skin));
    pieces.push(piece((at(0.02, 0.0), 1.565), (at(0.02, 0.0), 1.60), [0.085, 0.09], clothes.skin));
    pieces.push(piece((at(-0.025, 0.0), 1.60), (at(-0.01, 0.0), 1.612), [0.092, 0.088], clothes.hair));
    pieces
}

impl Piece {
    fn seen_by(&self, view: &View) -> Option<Limb> {
        let [(from, from_height_m), (to, to_height_m)] = self.ends;
        let [from, to] = [view.spot(&from), view.spot(&to)];
        if from.ahead_m.max(to.ahead_m) <= CUT_M {
            return None;
        }
        // The share of the way from one end to the other at which it comes before the lens.
        let cut = |end: Spot, other: Spot| ((CUT_M - end.ahead_m) / (other.ahead_m - end.ahead_m)).max(0.0);
        let shares = [if from.ahead_m < CUT_M { cut(from, to) } else { 0.0 }, if to.ahead_m < CUT_M { 1.0 - cut(to, from) } else { 1.0 }];
        let between = |from: f32, to: f32, share: f32| from + share * (to - from);
        let ends = shares.map(|share| {
            let spot = Spot { ahead_m: between(from.ahead_m, to.ahead_m, share), left_m: between(from.left_m, to.left_m, share) };
            let height_m = between(from_height_m, to_height_m, share);
            let column_px = view.column_px(spot);
            let sight = view.sight(column_px, 1.0);
            let radius_px = view.focal_px * between(self.radii_m[0], self.radii_m[1], share) / spot.ahead_m;
            (spot.ahead_m, [column_px, sight.row_px(height_m, spot.ahead_m)], radius_px, height_m)
        });
        let [(from_ahead_m, from, from_radius, from_height_m), (to_ahead_m, to, to_radius, to_height_m)] = ends;
        let across = [to[0] - from[0], to[1] - from[1]];
        let ahead_m = (from_ahead_m + to_ahead_m) / 2.0;
        Some(Limb {
            ahead_m,
            columns_px: [(from[0] - from_radius).min(to[0] - to_radius), (from[0] + from_radius).max(to[0] + to_radius)],
            from,
            across,
            length_squared: across[0] * across[0] + across[1] * across[1],
            radii: [from_radius, to_radius],
            heights_m: [from_height_m, to_height_m],
            pixel_m: ahead_m / view.focal_px,
            cloth: self.cloth,
        })
    }
}

impl Limb {
    /// Paints what a column shows of it.
    pub(super) fn paint(&self, column: &mut Column, sight: &Sight, weave: &Texture) {
        let right = sight.column_px - self.from[0];
        let rows = [self.from[1], self.from[1] + self.across[1]];
        let top_px = (rows[0] - self.radii[0]).min(rows[1] - self.radii[1]) - 1.0;
        let bottom_px = (rows[0] + self.radii[0]).max(rows[1] + self.radii[1]) + 1.0;
        for (_, row_px, pixel) in column.between(top_px, bottom_px) {
            let down = row_px - self.from[1];
            let along = (right * self.across[0] + down * self.across[1]) / self.length_squared.max(1e-6);
            let along = along.clamp(0.0, 1.0);
            let (x, y) = (right - along * self.across[0], down - along * self.across[1]);
            let radius = self.radii[0] + along * (self.radii[1] - self.radii[0]);
            let distance = (x * x + y * y).sqrt();
            let part = (radius - distance + 0.5).clamp(0.0, 1.0);
            if part > 0.0 {
                pixel.cover_with_walker(part, self.grey(x, along, radius, distance, weave));
            }
        }
    }

    /// Its grey level: the cloth, darker towards its edges and on the side away from the light.
    fn grey(&self, aside_px: f32, along: f32, radius: f32, distance: f32, weave: &Texture) -> f32 {
        let edge = distance / radius.max(0.1);
        let light = 1.04 - 0.22 * (edge * edge).min(1.0) - 0.08 * aside_px / radius.max(0.1);
        let cloth = &self.cloth;
        let height_m = self.heights_m[0] + along * (self.heights_m[1] - self.heights_m[0]);
        let woven = weave.at(aside_px * self.pixel_m + cloth.cut_m, height_m, self.pixel_m) / 128.0;
        // Stripes that are finer than the pixels run together.
        let (stripe, _) = floored(height_m / STRIPE_M);
        let seen = (1.5 - self.pixel_m / STRIPE_M * 2.0).clamp(0.0, 1.0);
        let striped = if stripe & 1 == 0 { 1.0 - cloth.stripes * (0.5 + 0.5 * seen) } else { 1.0 - cloth.stripes * (0.5 - 0.5 * seen) };
        cloth.grey * light * striped * (1.0 + cloth.rough * (woven - 1.0))
    }
}
