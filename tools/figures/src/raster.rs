//! A rectangle of cells in few colours.

use std::collections::BTreeMap;
use std::fmt::Write;

use crate::svg::{Svg, px};

/// Draws cells, row by row from the top, each by the name of its colour; no name leaves the ground as it is.
///
/// Neighbours of one colour are one piece and all pieces of a colour one path, so that a map stays a small file.
pub(crate) fn draw<'a>(svg: &mut Svg, [left, top]: [f64; 2], edge: f64, rows: impl Iterator<Item = Vec<Option<&'a str>>>) {
    let mut paths: BTreeMap<&str, String> = BTreeMap::new();
    for (row, cells) in rows.enumerate() {
        // Each edge is written as where it lies: neighbours share it to the last digit, and nothing shows between them.
        let [y, below] = [row, row + 1].map(|row| px(top + row as f64 * edge));
        let mut column = 0;
        for run in cells.chunk_by(|a, b| a == b) {
            if let Some(colour) = run.first().copied().flatten() {
                let [x, right] = [column, column + run.len()].map(|column| px(left + column as f64 * edge));
                // Writing into memory has no way to fail.
                let _ = write!(paths.entry(colour).or_default(), "M{x} {y}H{right}V{below}H{x}z");
            }
            column += run.len();
        }
    }
    for (colour, path) in paths {
        svg.path(&path, colour);
    }
}

/// Greys from white to black, and what lies between.
pub(crate) const GREYS: [&str; 17] = [
    "#ffffff", "#f0f0f0", "#e1e1e1", "#d2d2d2", "#c3c3c3", "#b4b4b4", "#a5a5a5", "#969696", "#878787", "#787878", "#696969", "#5a5a5a",
    "#4b4b4b", "#3c3c3c", "#2d2d2d", "#1e1e1e", "#101010",
];

/// The grey of a probability: 0 white, 1 black.
pub(crate) fn grey(probability: f64) -> &'static str {
    let last = GREYS.len() - 1;
    let index = (probability.clamp(0.0, 1.0) * last as f64).round() as usize;
    GREYS.get(index).copied().unwrap_or("#878787")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn neighbours_of_one_colour_are_one_piece() {
        let mut svg = Svg::new(4.0, 4.0);
        let rows = [vec![Some("#000"), Some("#000"), None, Some("#000")], vec![None, Some("#111"), None, None]];
        draw(&mut svg, [0.0, 1.0], 2.0, rows.into_iter());
        let text = svg.finish();
        assert!(text.contains("<path d='M0 1H4V3H0zM6 1H8V3H6z' fill='#000' shape-rendering='crispEdges'/>"), "{text}");
        assert!(text.contains("<path d='M2 3H4V5H2z' fill='#111' shape-rendering='crispEdges'/>"), "{text}");
    }

    #[test]
    fn the_unknown_is_between_free_and_occupied() {
        assert_eq!((grey(0.0), grey(0.5), grey(1.0), grey(f64::NAN)), ("#ffffff", "#878787", "#101010", "#ffffff"));
    }
}
