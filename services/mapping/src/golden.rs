//! Golden values of the sensor model, the update and the one-dimensional study, each computed by two independent writings.

use geometry::{Cell, Lattice};
use messages::{Pose, SonarReading};
use serde_json::Value;

use crate::integrate::{Beam, Integrator, add, probability};
use crate::numeric::{Lanes, all};
use crate::parameters::{Parameters, SensorParameters, TuningParameters};
use crate::sensor_model::{Extent, SensorModel};
use crate::tuning::Tuned;

const TOLERANCE: f64 = 1e-6;

fn golden(file: &str) -> Value {
    let path = format!("{}/../../tests/data/sonar/{file}", env!("CARGO_MANIFEST_DIR"));
    serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap()
}

fn first(lanes: Lanes) -> f32 {
    lanes.to_array()[0]
}

fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().unwrap().iter().map(|n| n.as_f64().unwrap()).collect()
}

#[test]
fn eq_2_agrees() {
    let file = golden("sensor_model.json");
    let models = file["models"].as_array().unwrap();
    assert_eq!(models.len(), 4);
    for golden in models {
        let number = |key: &str| golden[key].as_f64().unwrap();
        let sensor = SensorParameters { k_o: number("k_o"), sigma_r_m: number("sigma_r"), no_echo_free_m: 1.2, fades: None };
        let tuned = Tuned {
            theta_bar_rad: number("theta_bar_deg").to_radians(),
            sigma_theta_rad: number("sigma_theta_deg").to_radians(),
            k_e: number("k_e"),
        };
        let range = number("r");
        let echo = Extent::of_echo(&sensor, range);
        let silence = Extent::of_silence(&sensor, range);
        let model_of = |extent| SensorModel::new(&sensor, range, extent, tuned);
        assert!((f64::from(first(model_of(echo).a)) - number("a")).abs() < TOLERANCE);
        assert!((echo.b - number("b")).abs() < 1e-12 && (echo.c - number("c")).abs() < 1e-12);
        for row in golden["values"].as_array().unwrap() {
            let [z, theta_deg, p_echo, p_silence] = numbers(row).try_into().unwrap();
            let (z, theta) = (all(z as f32), all(theta_deg.to_radians() as f32));
            for (extent, expected) in [(echo, p_echo), (silence, p_silence)] {
                let model = model_of(extent);
                let p = probability(first(model.log_odds(z, theta)));
                assert!((p - expected).abs() < TOLERANCE, "p({}, {theta_deg}°) = {p}, expected {expected}, {golden:.0}", first(z));
                if first(z) < first(model.a) {
                    let short = probability(first(model.free_log_odds(z, theta)));
                    assert!((short - expected).abs() < TOLERANCE, "free p({}, {theta_deg}°) = {short}", first(z));
                }
            }
        }
    }
}

#[test]
fn eq_3_agrees() {
    let sequences = golden("bayes.json");
    for sequence in sequences.as_array().unwrap() {
        let l_max = sequence["l_max"].as_f64().unwrap() as f32;
        let mut log_odds = all(0.0);
        for (p, expected) in numbers(&sequence["p"]).into_iter().zip(numbers(&sequence["P_after"])) {
            log_odds = add(log_odds, all((p / (1.0 - p)).ln() as f32), all(-l_max), all(l_max));
            assert!((probability(first(log_odds)) - expected).abs() < TOLERANCE, "{sequence}");
        }
    }
}

/// Section 7.1 of the paper: one axis, one sensor at 0. A beam of a degree holds no cell beside the axis.
#[test]
fn the_one_dimensional_study_agrees() {
    // Nothing tuned: the middle of k_e, as the profiles have it.
    let fixed = TuningParameters { enabled: false, k_e: [[0.40; 3]; 3], ..TuningParameters::default() };
    for (name, tuning) in [("tuned", TuningParameters::default()), ("fixed", fixed)] {
        let sensor = SensorParameters { fades: None, ..SensorParameters::default() };
        let parameters = Parameters { half_beam_rad: 1.0_f64.to_radians(), sensor, tuning, ..Parameters::default() };
        let integrator = Integrator::new(&parameters).unwrap();
        let study = &golden("study_1d.json")[name];
        let mut lattice = Lattice::new(integrator.cell);
        let robot = Pose { y_m: integrator.cell.centre_of(0), ..Pose::default() };
        let mut compared = 0;
        for count in 1..=24 {
            let range_m = match count {
                1..=8 => 1.0,
                9..=16 => 1.6,
                _ => 0.5,
            };
            let reading = SonarReading { range_m, echo: 1, ..SonarReading::default() };
            Beam { map_from_robot: &geometry::MapFromRobot::from_wire(&robot), reading: &reading }.integrate(
                &mut lattice,
                &integrator,
                false,
            );
            let Some(profile) = study["profiles"].get(count.to_string()) else { continue };
            for (z, expected) in numbers(&study["z"]).into_iter().zip(numbers(profile)) {
                let found = probability(lattice.get(integrator.cell.cell_at(z, robot.y_m)));
                assert!((found - expected).abs() < TOLERANCE, "{name}, after {count}, at {z} m: {found}, expected {expected}");
                compared += 1;
            }
            assert!((-9..60).all(|column| [-1, 1].iter().all(|&row| lattice.get(Cell { row, column }) == 0.0)));
        }
        assert_eq!(compared, 6 * 50);
    }
}
