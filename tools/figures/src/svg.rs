//! A picture as SVG text.

use std::fmt::Write;

/// What is drawn so far.
#[derive(Debug, Clone)]
pub(crate) struct Svg {
    width: f64,
    height: f64,
    body: String,
}

/// Where a text is held.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Anchor {
    Start,
    Middle,
    End,
}

pub(crate) const INK: &str = "#1d2430";
pub(crate) const DIM: &str = "#667085";
pub(crate) const LIGHT: &str = "#d9dde3";
/// Colours of lines that are to be told apart.
pub(crate) const LINES: [&str; 5] = ["#1f6feb", "#d92d20", "#079455", "#c026d3", "#d9960a"];

impl Svg {
    /// An empty white picture, px.
    pub(crate) fn new(width: f64, height: f64) -> Self {
        let mut svg = Self { width, height, body: String::new() };
        svg.rectangle([0.0, 0.0], [width, height], "#ffffff");
        svg
    }

    pub(crate) fn rectangle(&mut self, [x, y]: [f64; 2], [width, height]: [f64; 2], fill: &str) {
        self.add(&format!("<rect x='{}' y='{}' width='{}' height='{}' fill='{fill}'/>", px(x), px(y), px(width), px(height)));
    }

    pub(crate) fn frame(&mut self, [x, y]: [f64; 2], [width, height]: [f64; 2], stroke: &str) {
        let place = format!("x='{}' y='{}' width='{}' height='{}'", px(x), px(y), px(width), px(height));
        self.add(&format!("<rect {place} fill='none' stroke='{stroke}'/>"));
    }

    pub(crate) fn circle(&mut self, [x, y]: [f64; 2], radius: f64, fill: &str) {
        self.add(&format!("<circle cx='{}' cy='{}' r='{}' fill='{fill}'/>", px(x), px(y), px(radius)));
    }

    /// A line through points.
    pub(crate) fn line(&mut self, points: impl IntoIterator<Item = [f64; 2]>, stroke: &str, width: f64) {
        let points: Vec<String> = points.into_iter().map(|[x, y]| format!("{},{}", px(x), px(y))).collect();
        let points = points.join(" ");
        self.add(&format!(
            "<polyline points='{points}' fill='none' stroke='{stroke}' stroke-width='{}' stroke-linejoin='round'/>",
            px(width)
        ));
    }

    /// Whatever a path says, filled; pieces that touch have no seam between them.
    pub(crate) fn path(&mut self, path: &str, fill: &str) {
        self.add(&format!("<path d='{path}' fill='{fill}' shape-rendering='crispEdges'/>"));
    }

    pub(crate) fn text(&mut self, [x, y]: [f64; 2], anchor: Anchor, size: f64, colour: &str, text: &str) {
        let anchor = match anchor {
            Anchor::Start => "start",
            Anchor::Middle => "middle",
            Anchor::End => "end",
        };
        let text = text.replace('&', "&amp;").replace('<', "&lt;");
        self.add(&format!(
            "<text x='{}' y='{}' text-anchor='{anchor}' font-size='{}' fill='{colour}'>{text}</text>",
            px(x),
            px(y),
            px(size)
        ));
    }

    /// A picture, as the base64 of a PNG.
    pub(crate) fn image(&mut self, [x, y]: [f64; 2], [width, height]: [f64; 2], png: &str) {
        let place = format!("x='{}' y='{}' width='{}' height='{}'", px(x), px(y), px(width), px(height));
        self.add(&format!("<image {place} href='data:image/png;base64,{png}'/>"));
    }

    /// The whole file.
    pub(crate) fn finish(self) -> String {
        let (width, height) = (px(self.width), px(self.height));
        format!(
            "<svg xmlns='http://www.w3.org/2000/svg' width='{width}' height='{height}' viewBox='0 0 {width} {height}' \
             font-family='sans-serif'>\n{}</svg>\n",
            self.body
        )
    }

    fn add(&mut self, element: &str) {
        // Writing into memory has no way to fail.
        let _ = writeln!(self.body, "{element}");
    }
}

/// A length to a hundredth of a pixel, without what says nothing.
pub(crate) fn px(value: f64) -> String {
    let text = format!("{value:.2}");
    let text = text.trim_end_matches('0').trim_end_matches('.');
    if text == "-0" { "0".to_owned() } else { text.to_owned() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lengths_are_short_and_texts_are_texts() {
        for (value, expected) in [(0.0, "0"), (-0.001, "0"), (1.0, "1"), (0.126, "0.13"), (-2.5, "-2.5"), (100.0, "100")] {
            assert_eq!(px(value), expected);
        }
        let mut svg = Svg::new(10.0, 20.0);
        svg.text([1.0, 2.0], Anchor::Middle, 12.0, INK, "a < b & c");
        let text = svg.finish();
        assert!(text.starts_with("<svg ") && text.contains(">a &lt; b &amp; c</text>") && text.ends_with("</svg>\n"));
    }
}
