//! Fig. 3: time-variant maps of a robot that stands in a room while a person crosses it, and the result of STD (section 4).

use geometry::Beam;
use geometry::{Cell, CellSize};
use messages::{Pose, SonarReading, SonarScan};
use stillmap_std::{Parameters, Rule, Std};

use crate::raster;
use crate::scenes::Error;
use crate::svg::{Anchor, DIM, INK, LINES, Svg};

const CELL_M: f64 = 0.05;
const HALF_BEAM_RAD: f64 = 12.5 * std::f64::consts::PI / 180.0;
/// The five sonars that look ahead, degrees.
const SONARS_DEG: [f64; 5] = [-30.0, -15.0, 0.0, 15.0, 30.0];
/// The room's far wall and side walls, m.
const FAR_M: f64 = 2.2;
const ASIDE_M: f64 = 1.3;
/// The person who crosses it: distance from the robot, radius, and place at each scan, m.
const PERSON_X_M: f64 = 1.25;
const PERSON_RADIUS_M: f64 = 0.25;
const PERSON_Y_M: [f64; 3] = [0.75, 0.25, -0.25];

/// Rows and columns of cells that are shown.
const ROWS: i32 = 30;
const COLUMNS: i32 = 48;
const EDGE: f64 = 5.2;

pub(crate) fn figure() -> Result<String, Error> {
    let cell = CellSize::new(CELL_M)?;
    let scans: Vec<SonarScan> = PERSON_Y_M.into_iter().map(scan).collect();
    let parameters = Parameters { rule: Rule::Visible, span_scans: 1, ..Parameters::default() };
    let mut std = Std::new(parameters)?;
    let motions: Vec<_> = (1..).zip(&scans).map(|(k, scan)| std.step(k * 500_000_000, scan)).collect();
    let newest = scans.last().zip(motions.last()).ok_or("a scan")?;

    let mut svg = Svg::new(1080.0, 400.0);
    let titles = ["(a) TVM at t − 2", "(b) TVM at t − 1", "(c) TVM at t", "(d) sonar temporal difference at t"];
    for (panel, title) in titles.into_iter().enumerate() {
        let at = [14.0 + 266.0 * panel as f64, 44.0];
        svg.text([at[0], 30.0], Anchor::Start, 14.0, INK, title);
        svg.rectangle(at, [f64::from(COLUMNS) * EDGE, 2.0 * f64::from(ROWS) * EDGE], "#f3f4f6");
        if panel < 3 {
            // Older tags are lighter.
            for (age, scan) in scans.iter().take(panel + 1).rev().enumerate().rev() {
                let colour = ["#101010", "#878787", "#c3c3c3"].get(age).copied().unwrap_or("#c3c3c3");
                paint(&mut svg, at, &tagged(cell, scan, u32::MAX), colour);
            }
        } else {
            let (scan, motion) = newest;
            let moving = motion.movers().iter().fold(0, |readings, mover| readings | mover.readings);
            paint(&mut svg, at, &tagged(cell, scan, !moving), "#c3c3c3");
            paint(&mut svg, at, &tagged(cell, scan, moving), LINES[1]);
        }
        draw_robot(&mut svg, at);
    }
    let words = "A room of 2.2 × 2.6 m, five sonars ahead, a person crosses it from the robot's left to its right. Darker: newer. Red: moves, for it was seen free.";
    svg.text([14.0, 384.0], Anchor::Start, 12.0, DIM, words);
    Ok(svg.finish())
}

/// The readings of the room and of a person at this place.
fn scan(person_y_m: f64) -> SonarScan {
    let readings: Vec<SonarReading> = (0..)
        .zip(SONARS_DEG)
        .map(|(sonar, degrees)| {
            let yaw_rad = degrees.to_radians();
            let wall_m = (FAR_M / yaw_rad.cos()).min(ASIDE_M / yaw_rad.sin().abs().max(1e-9));
            let distance_m = PERSON_X_M.hypot(person_y_m);
            let off_rad = (person_y_m.atan2(PERSON_X_M) - yaw_rad).abs();
            let is_hit = off_rad < HALF_BEAM_RAD + (PERSON_RADIUS_M / distance_m).asin();
            let range_m = if is_hit { wall_m.min(distance_m - PERSON_RADIUS_M) } else { wall_m };
            SonarReading { mount: Pose { yaw_rad, ..Pose::default() }, range_m, sonar, echo: 1 }
        })
        .collect();
    SonarScan::new(Pose::default(), &readings, false)
}

/// The cells that these readings of a scan tag.
fn tagged(cell: CellSize, scan: &SonarScan, readings: u32) -> Vec<Cell> {
    let chosen = scan.readings().iter().enumerate().filter(|(index, _)| readings & (1 << index) != 0);
    chosen.flat_map(|(_, reading)| Beam::new(&scan.pose, reading, HALF_BEAM_RAD).arc(cell, cell.metres())).collect()
}

fn paint(svg: &mut Svg, at: [f64; 2], cells: &[Cell], colour: &str) {
    let rows = (-ROWS..ROWS).rev().map(|row| {
        let of_row = |column| cells.contains(&Cell { row, column }).then_some(colour);
        (0..COLUMNS).map(of_row).collect()
    });
    raster::draw(svg, at, EDGE, rows);
}

fn draw_robot(svg: &mut Svg, [left, top]: [f64; 2]) {
    svg.circle([left + 4.0, top + f64::from(ROWS) * EDGE], 7.0, LINES[0]);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_who_walks_is_red() {
        let mut std = Std::new(Parameters { rule: Rule::Visible, span_scans: 1, ..Parameters::default() }).unwrap();
        let scans: Vec<SonarScan> = PERSON_Y_M.into_iter().map(scan).collect();
        let moving: Vec<u32> =
            (1..).zip(&scans).map(|(k, scan)| std.step(k * 500_000_000, scan).movers().iter().fold(0, |all, m| all | m.readings)).collect();
        let nearer =
            |scan: &SonarScan| scan.readings().iter().enumerate().filter(|(_, r)| r.range_m < 1.3).fold(0, |all, (i, _)| all | 1 << i);
        assert_eq!(moving[2], nearer(&scans[2]), "{moving:?}");
    }
}
