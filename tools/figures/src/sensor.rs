//! Fig. 1: what one echo says of the cells of its cone (eq. 2).

use messages::Layer;

use crate::chart::{Axis, Chart, legend};
use crate::raster;
use crate::scenes::{Cells, Error, cells, echo_ahead, map_of, paper_parameters};
use crate::svg::{Anchor, DIM, INK, LINES, Svg};

/// Fine, so that the picture shows the model and not the grid.
const CELL_M: f64 = 0.005;
const RANGE_M: f64 = 0.7;
/// Columns and rows to either side of the axis that are shown.
const COLUMNS: i32 = 200;
const ROWS: i32 = 50;
/// Upper left corner of the picture, and the edge of a cell in it, px.
const CORNER: [f64; 2] = [50.0, 40.0];
const EDGE: f64 = 2.1;
/// Probabilities that are shown white and black.
const SHADES: [f64; 2] = [0.3, 0.8];

pub(crate) fn figure() -> Result<String, Error> {
    let mut parameters = paper_parameters(CELL_M, 12.5);
    parameters.tuning.enabled = false;
    let cells = cells(&map_of(&parameters, [&echo_ahead(CELL_M, RANGE_M)])?, Layer::Filtered);

    let mut svg = Svg::new(1080.0, 330.0);
    draw_cone(&mut svg, &cells);
    draw_scale(&mut svg);

    let chart = Chart { at: [570.0, 40.0], size: [480.0, 214.0], x: [0.0, 1.0], y: [0.0, 1.0] };
    chart.axes(&mut svg, "(b) the same along three rays", Axis { name: "z, m", spaces: 10 }, Axis { name: "p(r | z, θ)", spaces: 4 });
    let rays = [(0.0_f64, "θ = 0°"), (6.0, "θ = 6°"), (11.0, "θ = 11°")];
    for ((degrees, _), colour) in rays.iter().zip(LINES) {
        let (sin, cos) = degrees.to_radians().sin_cos();
        let along = (1..200).map(|step| f64::from(step) * CELL_M);
        chart.line(&mut svg, along.map(|z| [z, between(&cells, z * cos / CELL_M, 0.5 + z * sin / CELL_M)]), colour);
    }
    let entries: Vec<(&str, &str)> = LINES.into_iter().zip(rays.map(|(_, name)| name)).collect();
    legend(&mut svg, [600.0, 312.0], &entries);
    Ok(svg.finish())
}

fn draw_cone(svg: &mut Svg, cells: &Cells) {
    let [left, top] = CORNER;
    svg.text([left, top - 10.0], Anchor::Start, 14.0, INK, "(a) p(r | z, θ) after an echo from 0.7 m");
    let shade = |row, column| Some(grey(at(cells, row, column)));
    let rows = (-ROWS..=ROWS).rev().map(|row| (0..COLUMNS).map(|column| shade(row, column)).collect());
    raster::draw(svg, CORNER, EDGE, rows);
    for tenth in 0..=10 {
        let x = left + f64::from(tenth) * 0.1 / CELL_M * EDGE;
        svg.text([x, 270.0], Anchor::Middle, 12.0, DIM, &format!("{:.1}", f64::from(tenth) / 10.0));
    }
    svg.text([left + 0.5 * f64::from(COLUMNS) * EDGE, 290.0], Anchor::Middle, 12.0, INK, "along the axis, m");
}

/// Which probability is shown how.
fn draw_scale(svg: &mut Svg) {
    let steps = raster::GREYS.len();
    let width = 220.0 / steps as f64;
    let left = CORNER[0] + 0.5 * (f64::from(COLUMNS) * EDGE - 220.0);
    for (step, shade) in raster::GREYS.into_iter().enumerate() {
        svg.rectangle([left + step as f64 * width, 302.0], [width, 10.0], shade);
    }
    svg.text([left - 6.0, 312.0], Anchor::End, 12.0, DIM, &format!("{}", SHADES[0]));
    svg.text([left + 226.0, 312.0], Anchor::Start, 12.0, DIM, &format!("{}", SHADES[1]));
}

fn grey(probability: f64) -> &'static str {
    let [white, black] = SHADES;
    raster::grey((probability - white) / (black - white))
}

fn at(cells: &Cells, row: i32, column: i32) -> f64 {
    cells.get(&(row, column)).copied().unwrap_or(0.5)
}

/// The probability at a place in cells, between the centres of the four around it.
fn between(cells: &Cells, x: f64, y: f64) -> f64 {
    let (column, row) = ((x - 0.5).floor(), (y - 0.5).floor());
    let (right, up) = (x - 0.5 - column, y - 0.5 - row);
    let (row, column) = (row as i32, column as i32);
    let along = |row| (1.0 - right) * at(cells, row, column) + right * at(cells, row, column + 1);
    (1.0 - up) * along(row) + up * along(row + 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn between_cells_the_nearer_one_says_more() {
        let cells = Cells::from([((0, 0), 0.0), ((0, 1), 1.0), ((1, 0), 0.0), ((1, 1), 1.0)]);
        for (x, y, expected) in [(0.5, 0.5, 0.0), (1.5, 0.5, 1.0), (1.0, 1.0, 0.5), (0.75, 1.2, 0.25)] {
            assert!((between(&cells, x, y) - expected).abs() < 1e-12, "{x} {y}");
        }
    }
}
