//! The golden values of section 5 of the paper: EM, LSE, AGM and Table 2 as printed. Those of background and candidate are checked on
//! the model itself, in `model.rs`.
#![allow(clippy::unwrap_used, clippy::panic, reason = "tests fail by panicking")]

use serde_json::Value;
use stillmap_sbs::alignment::{Covariance, Pair, region};
use stillmap_sbs::estimation::least_squares;
use stillmap_sbs::mixture::{EmRule, Fit, learn};
use stillmap_sbs::table2::{PixelGaussians, Table2Rule};
use stillmap_sbs::transform::{Class, Transform};

fn golden(part: &str) -> Value {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/data/sbs/golden.json");
    let text = std::fs::read_to_string(path).unwrap();
    serde_json::from_str::<Value>(&text).unwrap()[part].clone()
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or_else(|| panic!("no number: {value}"))
}

fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().unwrap().iter().map(number).collect()
}

fn close(name: &str, found: f64, expected: f64, tolerance: f64) {
    assert!((found - expected).abs() <= tolerance * expected.abs().max(1.0), "{name}: found {found}, expected {expected}");
}

#[test]
fn em_agrees() {
    for (name, case) in golden("em").as_object().unwrap() {
        let samples = numbers(&case["samples"]);
        let fit: Fit = learn(&samples, &EmRule::default()).unwrap();
        let trace = numbers(&case["ll"]);
        assert_eq!(fit.log_likelihood.len(), trace.len(), "{name}: steps");
        for (found, expected) in fit.log_likelihood.iter().zip(&trace) {
            close(name, *found, *expected, 1e-9);
        }
        let m = fit.mixture;
        close(name, m.background.mean, number(&case["muB"]), 1e-7);
        close(name, m.background.sigma, number(&case["sB"]), 1e-7);
        close(name, m.shadow.mean, number(&case["muS"]), 1e-7);
        close(name, m.shadow.sigma, number(&case["sS"]), 1e-7);
        let weights = numbers(&case["w_F_B_S"]);
        for (found, expected) in [m.weights.foreground, m.weights.background, m.weights.shadow].iter().zip(&weights) {
            close(name, *found, *expected, 1e-8);
        }
    }
}

fn places(value: &Value) -> Vec<[f64; 2]> {
    value.as_array().unwrap().iter().map(|p| [number(&p[0]), number(&p[1])]).collect()
}

fn matrix_agrees(name: &str, found: &Transform, expected: &Value, tolerance: f64) {
    let rows: Vec<f64> = expected.as_array().unwrap().iter().flat_map(numbers).collect();
    for (f, e) in found.rows().iter().zip(&rows) {
        assert!((f - e).abs() <= tolerance, "{name}: found {:?}, expected {rows:?}", found.rows());
    }
}

#[test]
fn least_squares_agree() {
    for (name, case) in golden("lse").as_object().unwrap() {
        let class = match name.as_str() {
            "translation" => Class::Translation,
            "similarity" => Class::Similarity,
            "affine" => Class::Affine,
            "homography" => Class::Homography,
            other => panic!("no class {other}"),
        };
        let frame = places(&case["frame"]);
        let pairs = |background: &Value| -> Vec<Pair> {
            frame.iter().zip(places(background)).map(|(&frame, background)| Pair { frame, background }).collect()
        };
        let exact = least_squares(class, &pairs(&case["background"])).unwrap();
        matrix_agrees(name, &exact, &case["T_exact"], 1e-9);
        let noisy = pairs(&case["background_noisy"]);
        let fit = least_squares(class, &noisy).unwrap();
        matrix_agrees(name, &fit, &case["T_fit_noisy"], 1e-7);
        let sigma = Covariance::of_residuals(&fit, &noisy);
        close(name, sigma.uu, number(&case["sigma_hat"][0][0]), 1e-7);
        close(name, sigma.uv, number(&case["sigma_hat"][0][1]), 1e-7);
        close(name, sigma.vv, number(&case["sigma_hat"][1][1]), 1e-7);
        close(name, sigma.rms(), number(&case["rms"]), 1e-7);
    }
}

#[test]
fn regions_agree() {
    for case in golden("agm").as_array().unwrap() {
        let centre = [number(&case["x_hat"][0]), number(&case["x_hat"][1])];
        let s = &case["sigma"];
        let sigma = Covariance { uu: number(&s[0][0]), uv: number(&s[0][1]), vv: number(&s[1][1]) };
        let found: Vec<(i64, i64, f64)> = region(centre, sigma, number(&case["hbar"])).iter().map(|p| (p.u, p.v, p.distance)).collect();
        let expected: Vec<Vec<f64>> = case["pixels_u_v_D"].as_array().unwrap().iter().map(numbers).collect();
        assert_eq!(found.len(), expected.len(), "{case}: found {found:?}");
        for (f, e) in found.iter().zip(&expected) {
            assert_eq!((f.0 as f64, f.1 as f64), (e[0], e[1]), "{case}");
            close("D", f.2, e[2], 1e-9);
        }
    }
}

#[test]
fn table_2_agrees() {
    for (name, case) in golden("table2").as_object().unwrap() {
        let rule = Table2Rule {
            gaussians_max: number(&case["K"]) as usize,
            distance_max: number(&case["D"]),
            variance_start: number(&case["v0"]),
            variance_min: number(&case["vmin"]),
            count_cap: number(&case["cap"]) as u32,
        };
        let mut pixel = PixelGaussians::default();
        for (step, expected) in case["trace"].as_array().unwrap().iter().enumerate() {
            let taken = pixel.update(number(&expected["z"]), &rule);
            assert_eq!(taken.gaussian as u64, expected["hit"].as_u64().unwrap(), "{name}, value {step}: hit");
            assert_eq!(taken.new, expected["new"].as_bool().unwrap(), "{name}, value {step}: new");
            assert_eq!(pixel.background().unwrap() as u64, expected["background"].as_u64().unwrap(), "{name}, value {step}");
            let gaussians = expected["gaussians"].as_array().unwrap();
            assert_eq!(pixel.gaussians().len(), gaussians.len(), "{name}, value {step}");
            for (found, expected) in pixel.gaussians().iter().zip(gaussians) {
                close(name, found.mean, number(&expected[0]), 1e-9);
                close(name, found.variance, number(&expected[1]), 1e-9);
                close(name, f64::from(found.count), number(&expected[2]), 0.0);
            }
        }
    }
}
