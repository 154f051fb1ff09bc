//! One walker against one blob or one echo, as measurements.

use std::f64::consts::FRAC_PI_2;

use geometry::{Beam, wrapped};
use messages::Pose;
use nalgebra::{Vector2, Vector4};
use tracking::{Measured, Motion};

use crate::sight::{Estimate, Sight};

/// From the front of the nearer leg to the middle of the body, m.
/// Half: 85.4 % / 1.35 %, twice: 84.5 % / 1.41 %.
pub(crate) const ECHO_TO_MIDDLE_M: f64 = 0.12;
/// Spread of that distance with the step, m.
/// Half: 86.3 % / 1.21 %, twice: 84.7 % / 1.27 %.
const ECHO_SD_M: f64 = 0.2;

/// An echo of a scan, as tracks need it.
#[derive(Debug, Clone, Copy)]
pub(crate) struct SonarEcho<'a> {
    pub(crate) beam: &'a Beam,
    /// S from the past alone.
    pub(crate) past: f64,
    /// Its run in its sonar.
    pub(crate) run: u64,
    /// The run begins with it.
    pub(crate) first: bool,
}

/// A blob's bearing and, when its feet tell it and it is one walker's alone, its distance along the camera's axis.
pub(crate) fn sighted(motion: &Motion, map_from_camera: &Pose, sight: &Sight, merged: bool) -> (Measured, Option<Measured>) {
    let origin = Vector2::new(map_from_camera.x_m, map_from_camera.y_m);
    let (sin, cos) = map_from_camera.yaw_rad.sin_cos();
    let mut found = sight.bearing;
    if merged {
        found.variance = (found.variance.sqrt() + 0.2 * sight.width_rad).powi(2);
    }
    let depth = sight.depth.filter(|_| !merged).map(|depth| along(motion, origin, Vector2::new(cos, sin), depth));
    (bearing(motion, origin, map_from_camera.yaw_rad, found), depth)
}

/// An echo's range as a measurement, and the walker's distance outside the beam, m.
pub(crate) fn ranged(motion: &Motion, beam: &Beam) -> Option<(Measured, f64)> {
    let place = motion.place_m();
    let aside_m = outside_m(beam, place);
    let origin = Vector2::from(beam.origin_m());
    let towards = place - origin;
    let distance_m = towards.norm();
    if distance_m < 0.05 {
        return None;
    }
    let found = Estimate { value: beam.range_m() + ECHO_TO_MIDDLE_M, variance: ECHO_SD_M.powi(2) };
    Some((along(motion, origin, towards / distance_m, found), aside_m))
}

/// Distance of the track from a place along a direction of length 1, as a measurement.
fn along(motion: &Motion, origin_m: Vector2<f64>, direction: Vector2<f64>, found: Estimate) -> Measured {
    let expected = (motion.place_m() - origin_m).dot(&direction);
    Measured { row: Vector4::new(direction.x, direction.y, 0.0, 0.0), residual: found.value - expected, variance: found.variance }
}

/// Bearing of the track from a place, against an axis, as a measurement.
fn bearing(motion: &Motion, origin_m: Vector2<f64>, axis_rad: f64, found: Estimate) -> Measured {
    let towards = motion.place_m() - origin_m;
    let distance_squared = towards.norm_squared().max(0.01);
    let turned = towards.y.atan2(towards.x) - axis_rad - found.value;
    let residual = -wrapped(turned);
    let row = Vector4::new(-towards.y / distance_squared, towards.x / distance_squared, 0.0, 0.0);
    Measured { row, residual, variance: found.variance }
}

/// How far a place lies outside a beam, m; 0 inside.
pub(crate) fn outside_m(beam: &Beam, place: Vector2<f64>) -> f64 {
    let seen = beam.see(place.x, place.y);
    if beam.covers(seen) {
        return 0.0;
    }
    let half_rad = beam.half_rad();
    let off_rad = seen.across_m.abs().atan2(seen.along_m) - half_rad;
    if off_rad >= FRAC_PI_2 { seen.z_m() } else { seen.z_m() * off_rad.sin() }
}
