//! Lines over two axes.

use crate::svg::{Anchor, DIM, INK, LIGHT, Svg};

/// Two axes and the rectangle between them.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Chart {
    /// Upper left corner, px.
    pub(crate) at: [f64; 2],
    /// Width and height, px.
    pub(crate) size: [f64; 2],
    /// First and last value of x.
    pub(crate) x: [f64; 2],
    /// First and last value of y.
    pub(crate) y: [f64; 2],
}

/// A name of an axis and how often it has a mark.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Axis<'a> {
    pub(crate) name: &'a str,
    /// Spaces between marks.
    pub(crate) spaces: u32,
}

impl Chart {
    /// The place of a value, px.
    pub(crate) fn place(&self, x: f64, y: f64) -> [f64; 2] {
        let share = |value: f64, [first, last]: [f64; 2]| (value - first) / (last - first);
        [self.at[0] + share(x, self.x) * self.size[0], self.at[1] + (1.0 - share(y, self.y)) * self.size[1]]
    }

    /// Draws frame, marks and names.
    pub(crate) fn axes(&self, svg: &mut Svg, title: &str, x: Axis<'_>, y: Axis<'_>) {
        let [left, top] = self.at;
        let [right, bottom] = [left + self.size[0], top + self.size[1]];
        for mark in 0..=x.spaces {
            let value = between(self.x, mark, x.spaces);
            let [at, _] = self.place(value, self.y[0]);
            svg.line([[at, top], [at, bottom]], LIGHT, 1.0);
            svg.text([at, bottom + 16.0], Anchor::Middle, 12.0, DIM, &number(value));
        }
        for mark in 0..=y.spaces {
            let value = between(self.y, mark, y.spaces);
            let [_, at] = self.place(self.x[0], value);
            svg.line([[left, at], [right, at]], LIGHT, 1.0);
            svg.text([left - 6.0, at + 4.0], Anchor::End, 12.0, DIM, &number(value));
        }
        svg.frame(self.at, self.size, DIM);
        svg.text([left, top - 9.0], Anchor::Start, 14.0, INK, title);
        svg.text([f64::midpoint(left, right), bottom + 34.0], Anchor::Middle, 12.0, INK, x.name);
        svg.text([right, top - 9.0], Anchor::End, 12.0, INK, y.name);
    }

    /// Draws a line through values.
    pub(crate) fn line(&self, svg: &mut Svg, values: impl IntoIterator<Item = [f64; 2]>, colour: &str) {
        svg.line(values.into_iter().map(|[x, y]| self.place(x, y)), colour, 2.0);
    }
}

/// Draws lines of these colours with their names, side by side.
pub(crate) fn legend(svg: &mut Svg, [mut x, y]: [f64; 2], entries: &[(&str, &str)]) {
    for (colour, name) in entries {
        svg.line([[x, y - 4.0], [x + 22.0, y - 4.0]], colour, 3.0);
        svg.text([x + 28.0, y], Anchor::Start, 12.0, INK, name);
        // A little more than the letters take: the font is the reader's.
        x += 50.0 + 7.0 * name.chars().count() as f64;
    }
}

fn between([first, last]: [f64; 2], mark: u32, spaces: u32) -> f64 {
    first + (last - first) * f64::from(mark) / f64::from(spaces.max(1))
}

fn number(value: f64) -> String {
    let text = format!("{value:.2}");
    let text = text.trim_end_matches('0').trim_end_matches('.');
    text.replace('-', "−")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_lie_where_the_axes_say() {
        let chart = Chart { at: [10.0, 20.0], size: [100.0, 50.0], x: [-1.0, 1.0], y: [0.0, 2.0] };
        assert_eq!(chart.place(-1.0, 0.0), [10.0, 70.0]);
        assert_eq!(chart.place(0.0, 2.0), [60.0, 20.0]);
        assert_eq!((between([0.0, 3.0], 1, 2), number(-0.5), number(2.0)), (1.5, "−0.5".to_owned(), "2".to_owned()));
    }
}
