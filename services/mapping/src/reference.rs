//! The integration of a beam against a slow, plain writing of the same in double precision: every cell near the beam, eq. 2 as printed.

use std::f64::consts::TAU;

use geometry::{Cell, Lattice, wrapped};
use messages::{Pose, SonarReading};
use proptest::prelude::*;

use crate::integrate::{Beam, Integrator, probability};
use crate::parameters::{Parameters, SensorParameters};

const CELL_M: f64 = 0.05;
const HALF_BEAM_DEG: f64 = 12.5;

fn fade(x: f64, middle: f64) -> f64 {
    0.5 * (1.0 - (2.0 * (x - middle)).tanh())
}

/// Triangular memberships over 0.5, 0.7, 0.9.
fn memberships(p: f64) -> [f64; 3] {
    let upper = ((p - 0.7) / 0.2).clamp(0.0, 1.0);
    let lower = ((0.7 - p) / 0.2).clamp(0.0, 1.0);
    [lower, 1.0 - upper - lower, upper]
}

fn blend(p: f64, outputs: [f64; 3]) -> f64 {
    memberships(p).iter().zip(outputs).map(|(m, o)| m * o).sum()
}

struct CellInBeam {
    cell: Cell,
    z: f64,
    theta: f64,
}

/// What the reading does to each cell, by the design's formulas with the default settings. `None` where rounding may decide otherwise.
fn reference(lattice: &Lattice<f32>, pose: &Pose, reading: &SonarReading, fades: bool, withheld: bool) -> Vec<(Cell, Option<f64>)> {
    let (k_o, sigma_r, l_max) = (0.8, 0.06, 2.0);
    let r = reading.range_m;
    let k_o = if fades { 0.501 + (k_o - 0.501) * fade(r, 2.0) } else { k_o };
    let half = sigma_r * (2.0_f64 * k_o).ln().sqrt();
    let (b, c) = if reading.echo == 1 { (r - half, r + half) } else { (1.2_f64.min(r - sigma_r), 1.2_f64.min(r - sigma_r)) };

    let sensor = pose.then(&reading.mount);
    let cells = lattice.cell_size();
    let near = cells.cell_at(sensor.x_m, sensor.y_m);
    let reach = (r / CELL_M) as i32 + 6;
    let all = (near.row - reach..=near.row + reach)
        .flat_map(|row| (near.column - reach..=near.column + reach).map(move |column| Cell { row, column }));
    let places: Vec<CellInBeam> = all
        .map(|cell| {
            let (dx, dy) = (cells.centre_of(cell.column) - sensor.x_m, cells.centre_of(cell.row) - sensor.y_m);
            let off = dy.atan2(dx) - sensor.yaw_rad;
            CellInBeam { cell, z: dx.hypot(dy), theta: wrapped(off) }
        })
        .collect();
    let in_cone = |place: &CellInBeam| place.theta.abs() <= HALF_BEAM_DEG.to_radians();
    let value = |place: &CellInBeam| probability(lattice.get(place.cell));

    let arc = places.iter().filter(|p| in_cone(p) && p.z >= b && p.z < c && value(p) > 0.5);
    let known = arc.max_by(|p, q| value(p).total_cmp(&value(q)).then(q.theta.abs().total_cmp(&p.theta.abs())));
    let (p_arc, theta_max) = known.map_or((0.5, 0.0), |place| (value(place), place.theta));
    let p_free = places.iter().filter(|p| in_cone(p) && p.z < b - CELL_M).map(value).fold(0.5, f64::max);
    let theta_bar = blend(p_arc, [0.0, 0.5, 1.0]) * theta_max;
    let sigma_theta = blend(p_arc, [30.0, 24.0, 16.0]).to_radians();
    let k_e_near = blend(p_free, [0.35, 0.40, 0.43]);
    let k_e = |z: f64| if fades { 0.5 - (0.5 - k_e_near) * fade(z, 1.6) } else { k_e_near };
    let a = if reading.echo == 1 { r - sigma_r * (k_o / k_e(b)).ln().sqrt() } else { b };

    let log_odds = |place: &CellInBeam| {
        if !in_cone(place) {
            return 0.0;
        }
        let angular = (-((place.theta - theta_bar) / sigma_theta).powi(2)).exp();
        let gauss = (-((r - place.z) / sigma_r).powi(2)).exp();
        let p = match place.z {
            z if z < a && (1.0 - k_e(z)) * angular > 0.5 => 1.0 - (1.0 - k_e(z)) * angular,
            z if z >= a && z < b && (1.0 - k_o * gauss) * angular > 0.5 => 1.0 - (1.0 - k_o * gauss) * angular,
            z if z >= b && z < c && !withheld && k_o * gauss * angular > 0.5 => k_o * gauss * angular,
            _ => 0.5,
        };
        (p / (1.0 - p)).ln()
    };
    let undecidable = |place: &CellInBeam| {
        let edge =
            (place.theta.abs() - HALF_BEAM_DEG.to_radians()).abs() < 1e-5 || [a, b, c].iter().any(|end| (place.z - end).abs() < 1e-5);
        edge || place.z < 1e-5
    };
    places
        .iter()
        .map(|place| {
            let after = (f64::from(lattice.get(place.cell)) + log_odds(place)).clamp(-l_max, l_max);
            (place.cell, (!undecidable(place)).then_some(after))
        })
        .collect()
}

fn reading() -> impl Strategy<Value = (Pose, SonarReading, bool)> {
    let pose = (-0.4..0.4f64, -0.4..0.4f64, prop_oneof![0.0..TAU, (0..8).prop_map(|k| f64::from(k) * TAU / 8.0)]);
    (pose, 0.1..3.0f64, prop::bool::weighted(0.8), any::<bool>()).prop_map(|((x_m, y_m, yaw_rad), range_m, echo, withheld)| {
        let mount = Pose { x_m: 0.1, y_m: -0.05, yaw_rad: 0.3 };
        (Pose { x_m, y_m, yaw_rad }, SonarReading { mount, range_m, sonar: 0, echo: u32::from(echo) }, withheld)
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]
    #[test]
    fn every_cell_is_as_the_plain_writing_has_it(readings in prop::collection::vec(reading(), 1..12), fades in any::<bool>()) {
        let faded = SensorParameters::default();
        let sensor = SensorParameters { fades: faded.fades.filter(|_| fades), ..faded };
        let integrator = Integrator::new(&Parameters { sensor, ..Parameters::default() }).unwrap();
        let mut lattice = Lattice::new(integrator.cell);
        for (pose, reading, withheld) in &readings {
            let expected = reference(&lattice, pose, reading, fades, *withheld);
            Beam { map_from_robot: &geometry::MapFromRobot::from_wire(pose), reading }.integrate(&mut lattice, &integrator, *withheld);
            for (cell, after) in expected {
                let found = f64::from(lattice.get(cell));
                prop_assert!(found.abs() <= 2.0);
                if let Some(after) = after {
                    // Single precision places a cell 3 m away to a micrometre; the surface's flank rises by 30 a metre.
                    prop_assert!((found - after).abs() < 5e-5, "{cell:?}: {found}, expected {after}; {pose:?} {reading:?} {withheld}");
                }
            }
        }
    }
}
