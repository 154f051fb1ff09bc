#![cfg_attr(test, allow(clippy::unwrap_used, clippy::panic, clippy::float_cmp, reason = "tests fail by panicking"))]

//! A moving thing in the plane: constant velocity disturbed by white acceleration, filtered (Kalman) and smoothed
//! (Rauch, Tung and Striebel).
//!
//! Metres, seconds; the frame is the caller's.

use nalgebra::{Matrix2, Matrix4, Vector2, Vector4};
use postcard_schema::Schema;
use postcard_schema::schema::{DataModelType, NamedType, NamedValue};
use serde::{Deserialize, Serialize};

/// What is believed of a thing at one time: mean and covariance of (x, y, vx, vy).
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Motion {
    /// x and y in m, vx and vy in m/s.
    pub mean: Vector4<f64>,
    /// Its covariance.
    pub covariance: Matrix4<f64>,
}

impl Schema for Motion {
    const SCHEMA: &'static NamedType = &NamedType {
        name: "Motion",
        ty: &DataModelType::Struct(&[
            &NamedValue { name: "mean", ty: <[f64; 4]>::SCHEMA },
            &NamedValue { name: "covariance", ty: <[f64; 16]>::SCHEMA },
        ]),
    };
}

/// One scalar that was measured, linear in the state near its mean.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Measured {
    /// Derivative of the measured quantity by the state.
    pub row: Vector4<f64>,
    /// Measured less expected.
    pub residual: f64,
    /// Variance of the measurement.
    pub variance: f64,
}

impl Motion {
    /// At a place, known to `place_sd_m`, moving by at most about `speed_sd_m_s` in any direction.
    #[must_use]
    pub fn at(place_m: Vector2<f64>, place_covariance: Matrix2<f64>, speed_sd_m_s: f64) -> Self {
        let mut covariance = Matrix4::zeros();
        covariance.fixed_view_mut::<2, 2>(0, 0).copy_from(&place_covariance);
        covariance[(2, 2)] = speed_sd_m_s * speed_sd_m_s;
        covariance[(3, 3)] = speed_sd_m_s * speed_sd_m_s;
        Self { mean: Vector4::new(place_m.x, place_m.y, 0.0, 0.0), covariance }
    }

    /// x and y, m.
    #[must_use]
    pub fn place_m(&self) -> Vector2<f64> {
        self.mean.fixed_rows::<2>(0).into()
    }

    /// vx and vy, m/s.
    #[must_use]
    pub fn velocity_m_s(&self) -> Vector2<f64> {
        self.mean.fixed_rows::<2>(2).into()
    }

    /// Covariance of x and y, m².
    #[must_use]
    pub fn place_covariance(&self) -> Matrix2<f64> {
        self.covariance.fixed_view::<2, 2>(0, 0).into()
    }

    /// After `dt_s` more (before: negative), with white acceleration of density `q`, m²/s³.
    #[must_use]
    pub fn predict(&self, dt_s: f64, q: f64) -> Self {
        let f = transition(dt_s);
        Self { mean: f * self.mean, covariance: f * self.covariance * f.transpose() + disturbance(dt_s.abs(), q) }
    }

    /// Variance of what a measurement is expected to differ by: the state's share and its own.
    #[must_use]
    pub fn innovation_variance(&self, measured: &Measured) -> f64 {
        (measured.row.transpose() * self.covariance * measured.row)[0] + measured.variance
    }

    /// With a measurement taken in. One whose expected spread is no positive number says nothing.
    #[must_use]
    pub fn update(&self, measured: &Measured) -> Self {
        let variance = self.innovation_variance(measured);
        if !(variance.is_finite() && variance > 0.0 && measured.residual.is_finite()) {
            return *self;
        }
        let gain = self.covariance * measured.row / variance;
        // Joseph's form: stays symmetric and positive.
        let keep = Matrix4::identity() - gain * measured.row.transpose();
        let covariance = keep * self.covariance * keep.transpose() + gain * gain.transpose() * measured.variance;
        Self { mean: self.mean + gain * measured.residual, covariance }
    }

    /// This belief with what was learned later: `later` is the smoothed belief `dt_s` after, `q` what disturbed on the way.
    #[must_use]
    pub fn smoothed(&self, later: &Self, dt_s: f64, q: f64) -> Self {
        let predicted = self.predict(dt_s, q);
        let Some(inverse) = predicted.covariance.try_inverse() else { return *self };
        let gain = self.covariance * transition(dt_s).transpose() * inverse;
        let mean = self.mean + gain * (later.mean - predicted.mean);
        let covariance = self.covariance + gain * (later.covariance - predicted.covariance) * gain.transpose();
        Self { mean, covariance: (covariance + covariance.transpose()) * 0.5 }
    }
}

fn transition(dt_s: f64) -> Matrix4<f64> {
    let mut f = Matrix4::identity();
    f[(0, 2)] = dt_s;
    f[(1, 3)] = dt_s;
    f
}

fn disturbance(dt_s: f64, q: f64) -> Matrix4<f64> {
    let (place, mixed, speed) = (q * dt_s.powi(3) / 3.0, q * dt_s.powi(2) / 2.0, q * dt_s);
    let mut covariance = Matrix4::zeros();
    for axis in 0..2 {
        covariance[(axis, axis)] = place;
        covariance[(axis, axis + 2)] = mixed;
        covariance[(axis + 2, axis)] = mixed;
        covariance[(axis + 2, axis + 2)] = speed;
    }
    covariance
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const Q: f64 = 1.2;

    fn start() -> Motion {
        Motion::at(Vector2::zeros(), Matrix2::identity(), 1.0)
    }

    fn of_x(motion: &Motion, x: f64) -> Measured {
        Measured { row: Vector4::x(), residual: x - motion.mean.x, variance: 0.01 }
    }

    #[test]
    fn it_finds_the_speed_of_what_moves_evenly() {
        let mut motion = start();
        for step in 1..50 {
            motion = motion.predict(0.1, Q);
            motion = motion.update(&of_x(&motion, 0.08 * f64::from(step)));
        }
        assert!((motion.velocity_m_s().x - 0.8).abs() < 0.02, "{motion:?}");
        assert_eq!(motion.velocity_m_s().y, 0.0);
    }

    #[test]
    fn smoothing_knows_the_start_from_what_came_after() {
        let first = start();
        let second = first.predict(0.1, Q);
        let second = second.update(&of_x(&second, 0.5));
        let smoothed = first.smoothed(&second, 0.1, Q);
        assert!(smoothed.mean.x > 0.3 && smoothed.covariance[(0, 0)] < first.covariance[(0, 0)]);
        // Two steps forward and nothing learned: nothing to be said about the start.
        let nothing = first.smoothed(&first.predict(0.1, Q), 0.1, Q);
        assert!((nothing.covariance - first.covariance).norm() < 1e-9);
    }

    #[test]
    fn a_measurement_without_a_spread_says_nothing() {
        let motion = start();
        for variance in [f64::NAN, f64::INFINITY, -10.0] {
            assert_eq!(motion.update(&Measured { row: Vector4::x(), residual: 1.0, variance }), motion);
        }
    }

    proptest! {
        #[test]
        fn variances_stay_positive(steps in proptest::collection::vec((0.0..0.5f64, -2.0..2.0f64, 1e-4..1.0f64), 1..60)) {
            let mut motion = start();
            for (dt, x, variance) in steps {
                motion = motion.predict(dt, Q);
                motion = motion.update(&Measured { variance, ..of_x(&motion, x) });
                prop_assert!((0..4).all(|i| motion.covariance[(i, i)] > 0.0));
            }
        }
    }
}
