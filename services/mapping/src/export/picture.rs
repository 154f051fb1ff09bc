//! `map.png`: the map for people.

use image::{Rgb, RgbImage};

use super::canvas::{Colour, disc, fill, line, text, text_width};
use super::font;
use super::rectangle::Rectangle;

/// Length aimed at for the longer side, px.
const LONG_SIDE: usize = 1400;
/// Most pixels along a cell's edge: small maps need no more.
const MAX_SCALE: usize = 24;

pub(super) const PAPER: Colour = Rgb([255, 255, 255]);
pub(super) const INK: Colour = Rgb([40, 44, 52]);
const FREE: Colour = Rgb([252, 252, 250]);
pub(super) const UNKNOWN: Colour = Rgb([186, 190, 196]);
const WALL: Colour = Rgb([24, 28, 38]);
pub(super) const WAY: Colour = Rgb([38, 110, 220]);
const START: Colour = Rgb([30, 160, 80]);
const END: Colour = Rgb([215, 50, 50]);

/// The strip below the map, with the scale bar and what the colours mean, px.
pub(super) const LEGEND_HEIGHT: u32 = 56;
pub(super) const PADDING: u32 = 24;
pub(super) const TEXT_SCALE: u32 = 3;
/// Log-odds from which a cell is drawn in its full colour: a few readings that agree.
const CERTAIN: f32 = 1.8;

/// The map with walls dark, free light and unknown grey, the robot's way, and a scale bar below.
pub(super) fn picture(map: &Rectangle, way_m: &[[f32; 2]]) -> RgbImage {
    let long = map.columns.max(map.rows);
    let scale = ((LONG_SIDE + long / 2) / long).clamp(1, MAX_SCALE);
    let (width, height) = ((map.columns * scale) as u32, (map.rows * scale) as u32);
    let legend = Legend::new(map.cell_m / scale as f64, width);
    let total_width = width.max(legend.width());
    let left = (total_width - width) / 2;

    let mut image = RgbImage::from_pixel(total_width, height + LEGEND_HEIGHT, UNKNOWN);
    let view = View { map, scale, left, top: 0 };
    view.draw(&mut image);
    view.draw_way(&mut image, way_m);
    fill(&mut image, 0, height, total_width, LEGEND_HEIGHT, PAPER);
    legend.draw(&mut image, height + LEGEND_HEIGHT / 2);
    image
}

/// Where on a picture a map lies.
pub(super) struct View<'a> {
    pub(super) map: &'a Rectangle,
    /// Pixels along a cell's edge.
    pub(super) scale: usize,
    /// Pixels beside it.
    pub(super) left: u32,
    /// Pixels above it.
    pub(super) top: u32,
}

impl View<'_> {
    pub(super) fn draw(&self, image: &mut RgbImage) {
        let edge = self.scale as u32;
        for (row, cells) in self.map.rows_from_top().enumerate() {
            for (column, &log_odds) in cells.iter().enumerate() {
                fill(image, self.left + column as u32 * edge, self.top + row as u32 * edge, edge, edge, shade(log_odds));
            }
        }
    }

    /// The robot's way with its start and end.
    pub(super) fn draw_way(&self, image: &mut RgbImage, way_m: &[[f32; 2]]) {
        let points = self.points(way_m);
        let (Some(start), Some(end)) = (points.first(), points.last()) else { return };
        line(image, &points, 2.5, WAY);
        for (place, colour) in [(start, START), (end, END)] {
            disc(image, *place, 9.0, PAPER);
            disc(image, *place, 7.0, colour);
        }
    }

    /// Places of the map frame, m, as pixels.
    pub(super) fn points(&self, places_m: &[[f32; 2]]) -> Vec<[f64; 2]> {
        let pixels_per_m = self.scale as f64 / self.map.cell_m;
        let bottom = f64::from(self.top) + (self.map.rows * self.scale) as f64;
        let to_pixels = |&[x, y]: &[f32; 2]| {
            let right = (f64::from(x) - self.map.origin_m[0]) * pixels_per_m;
            let up = (f64::from(y) - self.map.origin_m[1]) * pixels_per_m;
            [f64::from(self.left) + right, bottom - up]
        };
        places_m.iter().map(to_pixels).collect()
    }
}

fn shade(log_odds: f32) -> Colour {
    let target = if log_odds > 0.0 { WALL } else { FREE };
    let share = (log_odds.abs() / CERTAIN).min(1.0);
    let mut shade = UNKNOWN;
    for (channel, target) in shade.0.iter_mut().zip(target.0) {
        *channel = (f32::from(*channel) + (f32::from(target) - f32::from(*channel)) * share).round() as u8;
    }
    shade
}

/// The scale bar and the names of the colours.
struct Legend {
    bar: u32,
    bar_text: String,
    marks: [(&'static str, Colour); 3],
}

const MARK: u32 = 14;
const GAP: u32 = 10;

impl Legend {
    fn new(m_per_pixel: f64, picture_width: u32) -> Self {
        let most_m = 0.25 * f64::from(picture_width) * m_per_pixel;
        let steps = (-2..5).flat_map(|power| [1.0, 2.0, 5.0].map(|digit| digit * 10.0_f64.powi(power)));
        let bar_m = steps.take_while(|step| *step <= most_m).last().unwrap_or(0.01);
        let bar = (bar_m / m_per_pixel).round() as u32;
        Self { bar, bar_text: format!("{bar_m} m"), marks: [("start", START), ("end", END), ("way", WAY)] }
    }

    fn width(&self) -> u32 {
        let marks: u32 = self.marks.iter().map(|(name, _)| PADDING + MARK + GAP + text_width(name, TEXT_SCALE)).sum();
        2 * PADDING + self.bar + GAP + text_width(&self.bar_text, TEXT_SCALE) + marks
    }

    fn draw(&self, image: &mut RgbImage, middle: u32) {
        let text_top = middle - font::HEIGHT as u32 * TEXT_SCALE / 2;
        let mut x = PADDING;
        fill(image, x, middle - 2, self.bar, 4, INK);
        fill(image, x, middle - 9, 3, 18, INK);
        fill(image, (x + self.bar).saturating_sub(3), middle - 9, 3, 18, INK);
        x += self.bar + GAP;
        text(image, x, text_top, &self.bar_text, TEXT_SCALE, INK);
        x += text_width(&self.bar_text, TEXT_SCALE);
        for (name, colour) in self.marks {
            x += PADDING;
            let centre = [f64::from(x + MARK / 2), f64::from(middle)];
            if name == "way" {
                let half = f64::from(MARK / 2);
                line(image, &[[centre[0] - half, centre[1]], [centre[0] + half, centre[1]]], 2.5, colour);
            } else {
                disc(image, centre, f64::from(MARK / 2), colour);
            }
            x += MARK + GAP;
            text(image, x, text_top, name, TEXT_SCALE, INK);
            x += text_width(name, TEXT_SCALE);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::rectangle::tests::tile;
    use super::*;

    fn near(colour: Colour, other: Colour) -> bool {
        colour.0.iter().zip(other.0).all(|(a, b)| a.abs_diff(b) < 12)
    }

    #[test]
    fn walls_are_dark_free_is_light_and_the_way_is_drawn() {
        let cells: Vec<(usize, usize, f32)> = (0..32).flat_map(|c| [(10, c, 2.0), (5, c, -2.0)]).collect();
        let tiles = [tile(0, 0, &cells)];
        let map = Rectangle::around(tiles.iter()).unwrap();
        let image = picture(&map, &[[0.25, 0.55], [2.95, 0.55]]);
        // 48 cells wide, so 24 pixels each after the limit; the picture's first row is cell row 18.
        let at = |column: f64, row: f64| *image.get_pixel((24.0 * (column + 8.0)) as u32, (24.0 * (18.0 - row + 0.5)) as u32);
        assert_eq!(image.width(), 48 * 24);
        assert_eq!(at(5.5, 10.0), WALL);
        assert_eq!(at(5.5, 7.5), UNKNOWN);
        assert!(near(at(16.5, 5.0), WAY) && near(at(2.5, 5.0), START) && near(at(29.5, 5.0), END));
        assert_eq!(at(31.5, 5.0), FREE);
    }

    #[test]
    fn the_scale_bar_is_as_long_as_it_says() {
        for (m_per_pixel, width, bar, bar_text) in [(0.025, 1400, 200, "5 m"), (0.004, 900, 125, "0.5 m"), (0.05, 8000, 2000, "100 m")] {
            let legend = Legend::new(m_per_pixel, width);
            assert_eq!((legend.bar, legend.bar_text.as_str()), (bar, bar_text));
        }
    }

    #[test]
    fn every_character_of_the_legend_is_in_the_font() {
        let missing = font::glyph('\u{fffd}');
        for character in "0123456789. m".chars().chain(Legend::new(0.025, 1400).marks.iter().flat_map(|(name, _)| name.chars())) {
            assert_ne!(font::glyph(character), missing, "{character}");
        }
    }

    #[test]
    fn a_narrow_map_still_holds_the_legend() {
        let tiles: Vec<_> = (0..40).map(|row| tile(row, 0, &[(0, 0, 2.0), (31, 0, 2.0)])).collect();
        let map = Rectangle::around(tiles.iter()).unwrap();
        let image = picture(&map, &[]);
        assert!(image.width() > 17 && image.height() >= 1280);
        assert_eq!(*image.get_pixel(0, 0), UNKNOWN);
    }
}
