//! `comparison.png`: the map of every reading beside the map without what moves (Fig. 10 a and b of the paper).

use image::{Rgb, RgbImage};

use super::canvas::{Colour, fill, line, text, text_width};
use super::font;
use super::picture::{INK, LEGEND_HEIGHT, PADDING, PAPER, TEXT_SCALE, UNKNOWN, View};
use super::rectangle::Rectangle;

/// Length aimed at for the longer side of each map, px.
const LONG_SIDE: usize = 1000;
/// Most pixels along a cell's edge: small maps need no more.
const MAX_SCALE: usize = 16;
/// Width of the line between the two, px.
const BETWEEN: u32 = 12;
const WALKER: Colour = Rgb([230, 126, 34]);
const TITLES: [&str; 2] = ["a: every reading", "b: without what moves"];

/// Both maps at one scale with the robot's way, and the walkers' ways in thin lines.
pub(super) fn side_by_side(unfiltered: &Rectangle, map: &Rectangle, way_m: &[[f32; 2]], walkers_m: &[Vec<[f32; 2]>]) -> RgbImage {
    let maps = [unfiltered, map];
    let long = maps.iter().map(|map| map.columns.max(map.rows)).max().unwrap_or(1);
    let scale = ((LONG_SIDE + long / 2) / long).clamp(1, MAX_SCALE);
    // The maps differ by what a withheld reading alone had touched: the larger gives the frame of both.
    let columns = maps.iter().map(|map| map.columns).max().unwrap_or(1);
    let rows = maps.iter().map(|map| map.rows).max().unwrap_or(1);
    let least = TITLES.iter().map(|title| text_width(title, TEXT_SCALE)).max().unwrap_or(0) + 2 * PADDING;
    let (half, height) = (((columns * scale) as u32).max(least), (rows * scale) as u32);
    let mut image = RgbImage::from_pixel(2 * half + BETWEEN, height + LEGEND_HEIGHT, UNKNOWN);
    for ((map, title), left) in maps.into_iter().zip(TITLES).zip([0, half + BETWEEN]) {
        let view = View { map, scale, left, top: LEGEND_HEIGHT };
        view.draw(&mut image);
        for walker in walkers_m {
            line(&mut image, &view.points(walker), 1.2, WALKER);
        }
        view.draw_way(&mut image, way_m);
        fill(&mut image, left, 0, half, LEGEND_HEIGHT, PAPER);
        text(&mut image, left + PADDING, (LEGEND_HEIGHT - font::HEIGHT as u32 * TEXT_SCALE) / 2, title, TEXT_SCALE, INK);
    }
    fill(&mut image, half, 0, BETWEEN, height + LEGEND_HEIGHT, PAPER);
    image
}

#[cfg(test)]
mod tests {
    use super::super::rectangle::tests::tile;
    use super::*;

    #[test]
    fn what_only_the_left_map_has_stands_on_the_left() {
        let [every, without] = [2.0, 0.5].map(|ghost| {
            let tile = tile(0, 0, &[(4, 4, ghost), (10, 10, 2.0), (0, 0, -0.1), (31, 31, -0.1)]);
            Rectangle::around(std::iter::once(&tile)).unwrap()
        });
        let image = side_by_side(&every, &without, &[[0.1, 0.1]], &[vec![[0.5, 0.5], [2.0, 0.5]]]);
        let half = (image.width() - BETWEEN) / 2;
        let row = |cell: usize| LEGEND_HEIGHT + ((every.rows - 9 - cell) * MAX_SCALE + MAX_SCALE / 2) as u32;
        let column = |cell: usize| ((cell + 8) * MAX_SCALE + MAX_SCALE / 2) as u32;
        let at = |left: u32, cell: usize| *image.get_pixel(left + column(cell), row(cell));
        assert!(at(0, 4).0[0] < 60 && at(half + BETWEEN, 4).0[0] > 100);
        assert_eq!(at(0, 10), at(half + BETWEEN, 10));
    }

    #[test]
    fn every_character_of_the_titles_is_in_the_font() {
        let missing = font::glyph('\u{fffd}');
        assert!(TITLES.iter().flat_map(|title| title.chars()).all(|character| font::glyph(character) != missing));
    }
}
