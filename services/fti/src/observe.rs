//! One walker against one blob or one echo.

use std::f64::consts::FRAC_PI_2;

use geometry::Beam;
use messages::Pose;
use nalgebra::Vector2;
use tracking::Measured;

use crate::sight::{Estimate, Sight};
use crate::track::{Origin, Track, along, bearing};

/// From the front of the nearer leg to the middle of the body, m.
pub(crate) const ECHO_TO_MIDDLE_M: f64 = 0.12;
/// Spread of that distance with the step, m.
const ECHO_SD_M: f64 = 0.2;
/// Who stands is where he was, give or take a step: an echo farther off is another's, or the wall's, m.
const STANDS_M: f64 = 0.2;
/// Half of a body's width, m.
const BODY_HALF_M: f64 = 0.2;
/// What lies farther before him than this hides him, m.
const BEFORE_M: f64 = 0.3;
/// A reading that goes so far beyond him shows that he is gone, m.
const PASS_M: f64 = 0.45;
/// An echo supports a track within this many standard deviations.
pub(crate) const ECHO_GATE: f64 = 2.5;

impl Track {
    fn measured(&self, map_from_camera: &Pose, sight: &Sight, merged: bool) -> (Measured, Option<Measured>) {
        let origin = Vector2::new(map_from_camera.x_m, map_from_camera.y_m);
        let (sin, cos) = map_from_camera.yaw_rad.sin_cos();
        let mut found = sight.bearing;
        if merged {
            found.variance = (found.variance.sqrt() + 0.2 * sight.width_rad).powi(2);
        }
        let depth = sight.depth.filter(|_| !merged).map(|depth| along(&self.motion, origin, Vector2::new(cos, sin), depth));
        (bearing(&self.motion, origin, map_from_camera.yaw_rad, found), depth)
    }

    pub(crate) fn chi_squared(&self, map_from_camera: &Pose, sight: &Sight) -> f64 {
        let (bearing, depth) = self.measured(map_from_camera, sight, false);
        let term = |m: &Measured| m.residual * m.residual / self.motion.innovation_variance(m);
        term(&bearing) + depth.as_ref().map_or(0.0, term)
    }

    pub(crate) fn support_by_sight(&mut self, map_from_camera: &Pose, sight: &Sight, merged: bool, stamp_ns: u64) {
        let (bearing, _) = self.measured(map_from_camera, sight, merged);
        self.update(&bearing);
        if let (_, Some(depth)) = self.measured(map_from_camera, sight, merged) {
            self.update(&depth);
        }
        self.hits = self.hits.saturating_add(1);
        self.seen_ns = stamp_ns;
        self.unseen_ns = 0;
        self.passed = 0;
        self.remember();
    }

    /// Residual of an echo's range in standard deviations; `None` where the beam does not reach the track.
    pub(crate) fn echo_deviation(&self, beam: &Beam) -> Option<f64> {
        let (measured, aside_m) = self.range_measured(beam)?;
        (aside_m <= BODY_HALF_M).then(|| measured.residual / self.motion.innovation_variance(&measured).sqrt())
    }

    /// Whether an echo comes from where this one stands.
    pub(crate) fn stands_at(&self, beam: &Beam) -> bool {
        self.range_measured(beam).is_some_and(|(measured, aside_m)| aside_m <= BODY_HALF_M && measured.residual.abs() < STANDS_M)
    }

    /// An echo's range as a measurement, and the track's distance outside the beam, m.
    fn range_measured(&self, beam: &Beam) -> Option<(Measured, f64)> {
        let place = self.motion.place_m();
        let aside_m = outside_m(beam, place);
        let origin = Vector2::from(beam.origin_m());
        let towards = place - origin;
        let distance_m = towards.norm();
        if distance_m < 0.05 {
            return None;
        }
        let found = Estimate { value: beam.range_m() + ECHO_TO_MIDDLE_M, variance: ECHO_SD_M.powi(2) };
        Some((along(&self.motion, origin, towards / distance_m, found), aside_m))
    }

    pub(crate) fn support_by_echo(&mut self, beam: &Beam, stamp_ns: u64) {
        if let Some((measured, _)) = self.range_measured(beam) {
            self.update(&measured);
        }
        if self.origin == Origin::Sonar {
            self.hits = self.hits.saturating_add(1);
        }
        self.heard_ns = stamp_ns;
        (self.passed, self.missed) = (0, 0);
        self.remember();
    }

    pub(crate) fn note_passing(&mut self, beam: &Beam, stamp_ns: u64) {
        let place = self.motion.place_m();
        let seen = beam.see(place.x, place.y);
        if beam.covers(seen) && self.heard_ns != stamp_ns {
            self.passed = self.passed.saturating_add(u32::from(beam.range_m() > seen.z_m() + PASS_M));
            self.missed = self.missed.saturating_add(u32::from(beam.range_m() > seen.z_m() - BEFORE_M));
        }
    }
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
