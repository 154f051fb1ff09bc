//! Square tiles that repeat without a seam, kept at every size down to one texel: a pixel sees as much detail as it can hold.

use super::lattice::{eased, floored, share};

/// Texels along a side.
pub(super) const SIDE: usize = 256;

/// Sizes of a tile: 256, 128, … 1.
const LEVELS: usize = SIDE.ilog2() as usize + 1;

/// Texels along one metre.
pub(super) const TEXELS_PER_M: f32 = 100.0;

/// A tile of 2.56 m by 2.56 m in grey levels.
#[derive(Debug, Clone)]
pub(super) struct Texture {
    /// Every texel with its neighbours to the right, below, and below to the right: what lies between them is found at one place.
    levels: Vec<Vec<[u8; 4]>>,
}

impl Texture {
    /// A tile whose texel in column x and row y has this grey level.
    pub(super) fn new(grey: impl Fn(i32, i32) -> f32) -> Self {
        let side = SIDE as i32;
        let texels = (0..side).flat_map(|y| (0..side).map(move |x| (x, y))).map(|(x, y)| grey(x, y));
        let mut level: Vec<f32> = texels.collect();
        let mut levels = Vec::with_capacity(LEVELS);
        for size in (0..LEVELS).map(|number| SIDE >> number) {
            levels.push(with_neighbours(&level, size));
            level = halved(&level, size);
        }
        Self { levels }
    }

    /// Its grey level at a place, m, averaged over about so much of it, m.
    pub(super) fn at(&self, x_m: f32, y_m: f32, spread_m: f32) -> f32 {
        self.strip(x_m, spread_m).at(y_m)
    }

    /// Its grey levels along a line of the same x, averaged over about so much of it, m.
    pub(super) fn strip(&self, x_m: f32, spread_m: f32) -> Strip<'_> {
        let level = logarithm((spread_m * TEXELS_PER_M).max(1.0)).min((LEVELS - 1) as f32);
        let finer = level as usize;
        // Half of the way from one size to the next is left to each of the two alone: looking at one takes half the time.
        let coarse = ((level - finer as f32) * 2.0 - 0.5).clamp(0.0, 1.0);
        if coarse >= 1.0 {
            return Strip { first: self.line(finer + 1, x_m), other: None };
        }
        let other = (coarse > 0.0).then(|| (self.line(finer + 1, x_m), coarse));
        Strip { first: self.line(finer, x_m), other }
    }

    fn line(&self, level: usize, x_m: f32) -> Line<'_> {
        let scale = TEXELS_PER_M / (1_u32 << level) as f32;
        let (column, right) = floored(x_m * scale - 0.5);
        let side_mask = (SIDE >> level) - 1;
        Line {
            texels: self.levels.get(level).map_or(&[], Vec::as_slice),
            scale,
            side_mask,
            row_bits: side_mask.count_ones(),
            column: column as usize & side_mask,
            right,
        }
    }
}

/// A line of a texture.
#[derive(Debug, Clone, Copy)]
pub(super) struct Strip<'a> {
    first: Line<'a>,
    /// The next size, and how much of it there is in what is seen.
    other: Option<(Line<'a>, f32)>,
}

/// A line of a texture at one size.
#[derive(Debug, Clone, Copy)]
struct Line<'a> {
    texels: &'a [[u8; 4]],
    /// Texels along one metre.
    scale: f32,
    side_mask: usize,
    row_bits: u32,
    column: usize,
    /// How far it runs to the right of the column's middle.
    right: f32,
}

impl Strip<'_> {
    /// The grey level at a place along the line, m.
    pub(super) fn at(&self, y_m: f32) -> f32 {
        let grey = self.first.at(y_m);
        self.other.map_or(grey, |(line, part)| grey + part * (line.at(y_m) - grey))
    }
}

impl Line<'_> {
    fn at(&self, y_m: f32) -> f32 {
        let (row, down) = floored(y_m * self.scale - 0.5);
        let place = ((row as usize & self.side_mask) << self.row_bits) | self.column;
        let [here, beside, below, across] = self.texels.get(place).copied().unwrap_or_default().map(f32::from);
        let upper = here + self.right * (beside - here);
        let lower = below + self.right * (across - below);
        upper + down * (lower - upper)
    }
}

fn with_neighbours(level: &[f32], side: usize) -> Vec<[u8; 4]> {
    let at = |row: usize, column: usize| level.get((row % side) * side + column % side).map_or(0, |grey| (grey + 0.5) as u8);
    let places = (0..side).flat_map(|row| (0..side).map(move |column| (row, column)));
    places.map(|(row, column)| [at(row, column), at(row, column + 1), at(row + 1, column), at(row + 1, column + 1)]).collect()
}

fn halved(level: &[f32], side: usize) -> Vec<f32> {
    let half = side / 2;
    let at = |row: usize, column: usize| level.get(row * side + column).copied().unwrap_or(0.0);
    let places = (0..half).flat_map(|row| (0..half).map(move |column| (2 * row, 2 * column)));
    places.map(|(row, column)| (at(row, column) + at(row, column + 1) + at(row + 1, column) + at(row + 1, column + 1)) / 4.0).collect()
}

/// The logarithm to base 2 of a number of at least 1, straight between powers of two.
fn logarithm(number: f32) -> f32 {
    let bits = number.to_bits();
    let exponent = (bits >> 23) as f32 - 127.0;
    exponent + (bits & 0x7F_FFFF) as f32 / 8_388_608.0
}

/// Smooth blotches of about this many texels (a power of two), in [−1, 1], that repeat with the tile.
pub(super) fn blotches(seed: u32, x: i32, y: i32, texels: [i32; 2]) -> f32 {
    let cell = |place: i32, texels: i32| {
        let periods = SIDE as i32 / texels;
        let number = place.div_euclid(texels);
        (number.rem_euclid(periods), (number + 1).rem_euclid(periods), eased(place.rem_euclid(texels) as f32 / texels as f32))
    };
    let ((left, right, across), (top, bottom, down)) = (cell(x, texels[0]), cell(y, texels[1]));
    let corner = |x, y| share(seed, x, y);
    let upper = corner(left, top) + across * (corner(right, top) - corner(left, top));
    let lower = corner(left, bottom) + across * (corner(right, bottom) - corner(left, bottom));
    2.0 * (upper + down * (lower - upper)) - 1.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn texels_are_where_they_were_put_and_repeat() {
        let texture = Texture::new(|x, y| if (x, y) == (10, 20) { 255.0 } else { 0.0 });
        for (x_m, y_m) in [(0.105, 0.205), (0.105 + 2.56, 0.205 - 2.56)] {
            assert!((texture.at(x_m, y_m, 0.0) - 255.0).abs() < 0.1, "{x_m} {y_m}");
        }
        assert!(texture.at(0.125, 0.205, 0.0) < 0.1);
    }

    #[test]
    fn from_afar_a_tile_is_its_mean() {
        let texture = Texture::new(|x, _| if x % 2 == 0 { 0.0 } else { 200.0 });
        for x in 0..50 {
            assert!((texture.at(x as f32 * 0.013, 0.4, 5.0) - 100.0).abs() < 1.0);
        }
    }

    #[test]
    fn blotches_have_no_seam() {
        for y in 0..256 {
            assert!((blotches(5, 255, y, [32, 32]) - blotches(5, 0, y, [32, 32])).abs() < 0.15);
            assert_eq!(blotches(5, 256, y, [32, 32]), blotches(5, 0, y, [32, 32]));
        }
    }

    #[test]
    fn no_place_is_out_of_it() {
        let texture = Texture::new(|_, _| 7.0);
        for odd in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, f32::MAX, -1e30] {
            let _ = (texture.at(odd, 0.0, 0.0), texture.at(0.0, odd, 1.0), texture.at(1.0, 1.0, odd));
        }
    }
}
