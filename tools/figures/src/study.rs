//! Fig. 7: the one-dimensional study of section 7.1. An obstacle stands at 1 m, is moved to 1.6 m, then to 0.5 m.

use messages::{Layer, SonarScan};

use crate::chart::{Axis, Chart, legend};
use crate::scenes::{Error, cells, echo_ahead, map_of, paper_parameters};
use crate::svg::{LINES, Svg};

const CELL_M: f64 = 0.05;
/// Readings after which the profile is shown, in pairs.
const SHOWN: [([usize; 2], &str); 3] =
    [([7, 8], "(a) it stands at 1 m"), ([15, 16], "(b) moved to 1.6 m"), ([23, 24], "(c) moved to 0.5 m")];

pub(crate) fn figure() -> Result<String, Error> {
    // A beam of a degree holds no cell beside its axis.
    let parameters = paper_parameters(CELL_M, 1.0);
    let ranges_m = [[1.0; 8], [1.6; 8], [0.5; 8]].concat();
    let scans: Vec<SonarScan> = ranges_m.into_iter().map(|range_m| echo_ahead(CELL_M, range_m)).collect();
    let mut svg = Svg::new(1080.0, 330.0);
    for (panel, (counts, title)) in SHOWN.into_iter().enumerate() {
        let chart = Chart { at: [50.0 + 350.0 * panel as f64, 40.0], size: [310.0, 200.0], x: [0.0, 2.0], y: [0.0, 1.0] };
        chart.axes(&mut svg, title, Axis { name: "distance from the sensor, m", spaces: 4 }, Axis { name: "P(occupied)", spaces: 4 });
        let names = counts.map(|count| format!("after reading {count}"));
        for (count, colour) in counts.into_iter().zip(LINES) {
            let cells = cells(&map_of(&parameters, scans.iter().take(count))?, Layer::Filtered);
            // Each cell as wide as it is.
            let profile = (0..40).flat_map(|column| {
                let p = cells.get(&(0, column)).copied().unwrap_or(0.5);
                [[f64::from(column) * CELL_M, p], [f64::from(column + 1) * CELL_M, p]]
            });
            chart.line(&mut svg, profile, colour);
        }
        let entries: Vec<(&str, &str)> = LINES.into_iter().zip(names.iter().map(String::as_str)).collect();
        legend(&mut svg, [chart.at[0] + 10.0, 312.0], &entries);
    }
    Ok(svg.finish())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_map_follows_the_obstacle() {
        let parameters = paper_parameters(CELL_M, 1.0);
        let occupied = |ranges_m: &[f64]| -> Vec<i32> {
            let scans: Vec<SonarScan> = ranges_m.iter().map(|range_m| echo_ahead(CELL_M, *range_m)).collect();
            let cells = cells(&map_of(&parameters, &scans).unwrap(), Layer::Filtered);
            cells.into_iter().filter(|(_, p)| *p > mapping::OCCUPIED).map(|((_, column), _)| column).collect()
        };
        let first = occupied(&[1.0; 8]);
        assert!(!first.is_empty() && first.iter().all(|column| (18..=21).contains(column)), "{first:?}");
        let second = occupied(&[[1.0; 8], [1.6; 8]].concat());
        assert!(!second.is_empty() && second.iter().all(|column| (30..=33).contains(column)), "{second:?}");
    }
}
