//! The verdict on a reading: one likelihood ratio.

use nalgebra::Vector2;

use crate::observe::{ECHO_TO_MIDDLE_M, outside_m};
use crate::pending::PendingReading;
use crate::smoothed::{Presence, Smoothed};

/// A walker without a track, at any place and for any time.
/// Half: 85.0 % / 1.34 %, twice: 85.0 % / 1.36 %.
const UNSEEN: f64 = 0.005;
/// ln of how much likelier an untracked walker makes an echo that its sonar had only once, where others are or no camera looks.
/// Half: 80.9 % / 1.04 %, twice: 85.2 % / 4.03 %.
const BRIEF: f64 = 2.2;
/// The same where the camera looks and shows no walker, or has shown none anywhere for long.
/// Half: 85.0 % / 1.54 %, twice: 84.6 % / 1.34 %.
const BRIEF_ALONE: f64 = -0.5;
/// By how much that falls with each second for which the sonar heard the same thing, 1/s.
/// Half: 84.8 % / 3.72 %, twice: 79.6 % / 1.09 %.
const BRIEF_SLOPE: f64 = 2.5;
/// Spread of an echo's range about the front of a body, m.
/// Half: 84.7 % / 1.32 %, twice: 83.9 % / 1.21 %.
const RANGE_SD_M: f64 = 0.16;
/// Spread of a body aside of its middle, m.
/// Half: 84.5 % / 1.26 %, twice: 85.8 % / 1.57 %.
const ASIDE_SD_M: f64 = 0.2;
/// How fast a pending reading's weight as a hit falls with the evidence for a walker.
/// Half: 85.1 % / 1.40 %, twice: 78.7 % / 1.24 %.
const WEIGHT_SLOPE: f64 = 0.7;

/// ln of how much likelier the walkers who are followed make a reading than an even spread over all ranges (T).
pub(crate) fn walker(reading: &PendingReading, walkers: &[Presence], range_limit_m: f64) -> f64 {
    let likelihoods = walkers.iter().map(|walker| walker.existence * range_limit_m * likelihood(reading, walker));
    (UNSEEN + likelihoods.sum::<f64>()).ln()
}

/// The same for an untracked walker, by how long the echo lasted: people who pass beside or behind the robot leave a beam sooner
/// than what the robot passes. `no_recent_track`: the camera has shown no walker for long.
pub(crate) fn untracked_walker(reading: &PendingReading, dwell_s: f64, no_recent_track: bool) -> f64 {
    let brief = if reading.watched || no_recent_track { BRIEF_ALONE } else { BRIEF };
    brief - BRIEF_SLOPE * dwell_s
}

/// N(r − (d − 0.12); 0, u'Σu + 0.16²) exp(−l² / 2 (n'Σn + 0.2²)).
fn likelihood(reading: &PendingReading, walker: &Presence) -> f64 {
    let place = walker.motion.place_m();
    let covariance = walker.motion.place_covariance();
    let towards = place - Vector2::from(reading.beam.origin_m());
    let distance_m = towards.norm();
    let u = if distance_m > 1e-6 { towards / distance_m } else { Vector2::x() };
    let n = Vector2::new(-u.y, u.x);
    let range_variance = u.dot(&(covariance * u)) + RANGE_SD_M.powi(2);
    let aside_variance = n.dot(&(covariance * n)) + ASIDE_SD_M.powi(2);
    let residual_m = reading.beam.range_m() - (distance_m - ECHO_TO_MIDDLE_M);
    let aside_m = outside_m(&reading.beam, place);
    let density = (-0.5 * residual_m * residual_m / range_variance).exp() / (std::f64::consts::TAU * range_variance).sqrt();
    let density = density * (-0.5 * aside_m * aside_m / aside_variance).exp();
    if density.is_finite() { density } else { 0.0 }
}

/// The walkers at the time of a scan.
pub(crate) fn presences(walkers: &[Smoothed], stamp_ns: u64) -> Vec<Presence> {
    walkers.iter().filter_map(|walker| walker.at(stamp_ns)).collect()
}

/// Weight of a pending reading as a hit of something that stands.
pub(crate) fn weight(t: f64, past: f64) -> f64 {
    1.0 / (1.0 + ((t - 0.5 * past.clamp(0.0, 3.0)) / WEIGHT_SLOPE).exp())
}
