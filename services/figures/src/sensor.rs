//! Fig. 1: what one echo says of the cells of its cone (eq. 2).

use messages::Layer;

use crate::chart::{Axis, Chart, legend};
use crate::raster;
use crate::scenes::{Error, cells, echo_ahead, map_of, paper_settings};
use crate::svg::{Anchor, DIM, INK, LINES, Svg};

const CELL_M: f64 = 0.01;
const RANGE_M: f64 = 0.7;
/// Columns and rows to either side of the axis that are shown.
const COLUMNS: i32 = 100;
const ROWS: i32 = 25;
const EDGE: f64 = 4.2;

pub(crate) fn figure() -> Result<String, Error> {
    let mut settings = paper_settings(CELL_M, 12.5)?;
    settings.tuning.enabled = false;
    let cells = cells(&map_of(&settings, [&echo_ahead(CELL_M, RANGE_M)])?, Layer::Filtered);
    let at = |row: i32, column: i32| cells.get(&(row, column)).copied().unwrap_or(0.5);

    let mut svg = Svg::new(1080.0, 330.0);
    svg.text([50.0, 30.0], Anchor::Start, 14.0, INK, "(a) P(occupied) after an echo from 0.7 m; darker: more likely");
    let rows = (-ROWS..=ROWS).rev().map(|row| (0..COLUMNS).map(|column| Some(raster::grey(at(row, column)))).collect());
    raster::draw(&mut svg, [50.0, 40.0], EDGE, rows);
    for tenth in 0..=10 {
        let x = 50.0 + f64::from(tenth) * 10.0 * EDGE;
        svg.text([x, 270.0], Anchor::Middle, 12.0, DIM, &format!("{:.1}", f64::from(tenth) / 10.0));
    }
    svg.text([260.0, 290.0], Anchor::Middle, 12.0, INK, "along the axis, m");

    let chart = Chart { at: [570.0, 40.0], size: [480.0, 214.0], x: [0.0, 1.0], y: [0.0, 1.0] };
    chart.axes(&mut svg, "(b) the same along three rays", Axis { name: "z, m", spaces: 10 }, Axis { name: "p(r | z, θ)", spaces: 4 });
    let rays = [(0.0_f64, "θ = 0°"), (6.0, "θ = 6°"), (11.0, "θ = 11°")];
    for ((degrees, _), colour) in rays.iter().zip(LINES) {
        let (sin, cos) = degrees.to_radians().sin_cos();
        let along = (1..100).map(|step| f64::from(step) * CELL_M);
        let values = along.map(|z| [z, at((0.5 + z * sin / CELL_M).floor() as i32, (z * cos / CELL_M).floor() as i32)]);
        chart.line(&mut svg, values, colour);
    }
    let entries: Vec<(&str, &str)> = LINES.into_iter().zip(rays.map(|(_, name)| name)).collect();
    legend(&mut svg, [600.0, 312.0], &entries);
    Ok(svg.finish())
}
