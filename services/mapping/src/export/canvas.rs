//! Drawing on a picture: text, rectangles, and smooth lines and discs.

use image::{Rgb, RgbImage};

use super::font;

pub(super) type Colour = Rgb<u8>;

/// Fills a rectangle; what lies outside the picture is left out.
pub(super) fn fill(image: &mut RgbImage, left: u32, top: u32, width: u32, height: u32, colour: Colour) {
    for y in top..top.saturating_add(height).min(image.height()) {
        for x in left..left.saturating_add(width).min(image.width()) {
            image.put_pixel(x, y, colour);
        }
    }
}

/// Pixels of a text's width at a scale, without the gap after its last character.
pub(super) fn text_width(text: &str, scale: u32) -> u32 {
    (text.chars().count() as u32 * (font::WIDTH as u32 + 1)).saturating_sub(1) * scale
}

/// Writes a text with its upper left corner at a place.
pub(super) fn text(image: &mut RgbImage, left: u32, top: u32, text: &str, scale: u32, colour: Colour) {
    for (index, character) in text.chars().enumerate() {
        let start = left + index as u32 * (font::WIDTH as u32 + 1) * scale;
        for (y, row) in font::glyph(character).into_iter().enumerate() {
            for x in (0..font::WIDTH).filter(|x| row & (1 << (font::WIDTH - 1 - x)) != 0) {
                fill(image, start + x as u32 * scale, top + y as u32 * scale, scale, scale, colour);
            }
        }
    }
}

/// Fills a disc with a smooth edge.
pub(super) fn disc(image: &mut RgbImage, centre: [f64; 2], radius: f64, colour: Colour) {
    line(image, &[centre], 2.0 * radius, colour);
}

/// Draws a line through all points with smooth edges and round ends.
pub(super) fn line(image: &mut RgbImage, points: &[[f64; 2]], width: f64, colour: Colour) {
    let (image_width, image_height) = image.dimensions();
    // The coverage of each pixel by the whole line: short pieces that overlap must not add up.
    let mut coverage = vec![0.0_f64; image_width as usize * image_height as usize];
    let reach = width / 2.0 + 1.0;
    let pixels = |low: f64, high: f64, end: u32| (low - reach).floor().max(0.0) as u32..((high + reach).ceil().max(0.0) as u32).min(end);
    let ends = points.iter().skip(1).chain(points.last());
    for (from, to) in points.iter().zip(ends) {
        for y in pixels(from[1].min(to[1]), from[1].max(to[1]), image_height) {
            for x in pixels(from[0].min(to[0]), from[0].max(to[0]), image_width) {
                let off = distance([f64::from(x) + 0.5, f64::from(y) + 0.5], *from, *to);
                let covered = (width / 2.0 + 0.5 - off).clamp(0.0, 1.0);
                let place = &mut coverage[y as usize * image_width as usize + x as usize];
                *place = place.max(covered);
            }
        }
    }
    for (pixel, covered) in image.pixels_mut().zip(coverage).filter(|(_, covered)| *covered > 0.0) {
        for (channel, target) in pixel.0.iter_mut().zip(colour.0) {
            *channel = (f64::from(*channel) + (f64::from(target) - f64::from(*channel)) * covered).round() as u8;
        }
    }
}

/// Distance of a point from a segment.
fn distance(point: [f64; 2], from: [f64; 2], to: [f64; 2]) -> f64 {
    let along = [to[0] - from[0], to[1] - from[1]];
    let off = [point[0] - from[0], point[1] - from[1]];
    let length2 = along[0] * along[0] + along[1] * along[1];
    let share = if length2 > 0.0 { ((off[0] * along[0] + off[1] * along[1]) / length2).clamp(0.0, 1.0) } else { 0.0 };
    (off[0] - share * along[0]).hypot(off[1] - share * along[1])
}
