//! Maps of one drive side by side, at one scale.

use crate::picture;
use crate::scenes::{Cells, Error};
use crate::svg::{Anchor, DIM, INK, Svg};

/// Shown for a cell of which nothing is known: lighter than the doubtful ones.
const UNKNOWN: f64 = 0.4;
/// Cells kept around what is known.
const MARGIN: i32 = 4;
const WIDTH: f64 = 1080.0;
const LEFT: f64 = 14.0;

/// Two maps with a title each, and a line of words below them.
pub(crate) fn figure(panels: [(&Cells, &str); 2], words: &str) -> Result<String, Error> {
    let known = || panels.iter().flat_map(|(cells, _)| cells.keys());
    let rows = span(known().map(|cell| cell.0));
    let columns = span(known().map(|cell| cell.1));
    let edge = 0.5 * (WIDTH - 3.0 * LEFT) / f64::from(columns.end() - columns.start() + 1);
    let height = edge * f64::from(rows.end() - rows.start() + 1);

    let mut svg = Svg::new(WIDTH, height + 72.0);
    for (panel, (cells, title)) in panels.into_iter().enumerate() {
        let (left, top) = (LEFT + panel as f64 * 0.5 * (WIDTH - LEFT), 36.0);
        svg.text([left, top - 9.0], Anchor::Start, 14.0, INK, title);
        let shade = |row, column| grey(cells.get(&(row, column)).copied().unwrap_or(UNKNOWN));
        let pixels: Vec<u8> = rows.clone().rev().flat_map(|row| columns.clone().map(move |column| shade(row, column))).collect();
        picture::draw(&mut svg, [left, top], edge, u32::try_from(columns.end() - columns.start() + 1)?, &pixels)?;
    }
    svg.text([LEFT, height + 60.0], Anchor::Start, 12.0, DIM, words);
    Ok(svg.finish())
}

/// The grey of a probability: 0 white, 1 black.
fn grey(probability: f64) -> u8 {
    (255.0 * (1.0 - probability.clamp(0.0, 1.0))).round() as u8
}

fn span(numbers: impl Iterator<Item = i32> + Clone) -> std::ops::RangeInclusive<i32> {
    numbers.clone().min().unwrap_or(0) - MARGIN..=numbers.max().unwrap_or(0) + MARGIN
}
