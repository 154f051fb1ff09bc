//! What things are made of, as tiles.

use super::lattice::share;
use super::texture::{Texture, blotches};

/// Every material of a world.
#[derive(Debug, Clone)]
pub(super) struct Materials {
    pub(super) plaster: Texture,
    pub(super) floor: Texture,
    pub(super) ceiling: Texture,
    pub(super) wood: Texture,
    pub(super) poster: Texture,
    pub(super) cloth: Texture,
}

/// Edge of a floor tile, texels.
const TILE: i32 = 32;

impl Materials {
    /// The materials of a seed.
    pub(super) fn of(seed: u32) -> Self {
        let of = |number: u32| seed.wrapping_mul(31).wrapping_add(number);
        Self {
            plaster: Texture::new(|x, y| 164.0 + stains(of(1), x, y, 9.0)),
            floor: Texture::new(|x, y| floor(of(2), x, y)),
            ceiling: Texture::new(|x, y| ceiling(of(3), x, y)),
            wood: Texture::new(|x, y| 96.0 + 9.0 * blotches(of(4), x, y, [4, 128]) + 6.0 * blotches(of(5), x, y, [16, 64])),
            poster: Texture::new(|x, y| 138.0 + 40.0 * blotches(of(6), x, y, [8, 8]) + 30.0 * blotches(of(7), x, y, [4, 4])),
            cloth: Texture::new(|x, y| 128.0 + 26.0 * blotches(of(8), x, y, [8, 8]) + 14.0 * blotches(of(9), x, y, [2, 4])),
        }
    }
}

/// Unevenness of several sizes, the largest the strongest.
fn stains(seed: u32, x: i32, y: i32, depth: f32) -> f32 {
    let sizes = [(64, 1.0), (32, 0.7), (16, 0.6), (8, 0.5), (4, 0.4)];
    sizes.into_iter().map(|(texels, weight)| weight * blotches(seed.wrapping_add(texels as u32), x, y, [texels, texels])).sum::<f32>()
        * depth
}

/// Square tiles with dark joints.
fn floor(seed: u32, x: i32, y: i32) -> f32 {
    let joint = x.rem_euclid(TILE) < 1 || y.rem_euclid(TILE) < 1;
    let tile = 16.0 * (share(seed, x.div_euclid(TILE), y.div_euclid(TILE)) - 0.5);
    112.0 + tile + stains(seed, x, y, 9.0) - if joint { 34.0 } else { 0.0 }
}

/// Panels with lamps in them.
fn ceiling(seed: u32, x: i32, y: i32) -> f32 {
    if (32..64).contains(&x) && (64..192).contains(&y) {
        return 250.0;
    }
    let joint = x.rem_euclid(64) < 1 || y.rem_euclid(64) < 1;
    196.0 + stains(seed, x, y, 4.0) - if joint { 30.0 } else { 0.0 }
}
