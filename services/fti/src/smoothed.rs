//! Where a walker was, with everything known until now.

use messages::seconds;
use tracking::Motion;

use crate::track::{ACCELERATION, Origin, Track};

/// A blob or an echo speaks for this long, s; then confidence fades.
/// Half: 85.0 % / 1.35 %, twice: 85.0 % / 1.36 %.
const FRESH_S: f64 = 0.3;
/// Time in which it fades by a factor e, s.
/// Half: 85.0 % / 1.35 %, twice: 85.0 % / 1.36 %.
const FADE_S: f64 = 1.5;
/// Existence probability of a stationary walker that no sensor sees any more.
/// Half: 85.0 % / 1.25 %, twice: 85.1 % / 1.48 %.
const HELD: f64 = 0.5;
/// The same before the first sight.
/// Half: 85.0 % / 1.35 %, twice: 85.0 % / 1.37 %.
const BACK_DATED: f64 = 0.6;
/// First speed under which a walker is taken to have stood before, m/s.
/// Half: 84.9 % / 1.35 %, twice: 85.0 % / 1.35 %.
const STOOD_M_S: f64 = 0.6;
/// A walker over the horizon.
#[derive(Debug, Clone)]
pub(crate) struct Smoothed {
    /// At each support, the oldest first; the acceleration until the next.
    moments: Vec<(u64, Motion, f64)>,
    /// Part of its trust that does not change.
    existence: f64,
    stationary: bool,
    /// Its first moment is its first support.
    has_first_support: bool,
    ended_ns: Option<u64>,
}

/// Where a walker was at one time, and how sure that is, 0 to 1 (π).
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Presence {
    pub(crate) motion: Motion,
    pub(crate) existence: f64,
}

impl Smoothed {
    /// Rauch, Tung and Striebel over what the track believed.
    pub(crate) fn of(track: &Track) -> Option<Self> {
        let existence = match (track.origin, track.confirmed()) {
            (_, true) => 1.0,
            (Origin::Sonar, false) => 0.3 + 0.1 * f64::from(track.hits),
            (Origin::Camera, false) => return None,
        };
        let mut moments: Vec<(u64, Motion, f64)> = track.history.iter().map(|b| (b.stamp_ns, b.motion, b.acceleration)).collect();
        for index in (0..moments.len().saturating_sub(1)).rev() {
            let (later_ns, later, _) = moments[index + 1];
            let (stamp_ns, motion, acceleration) = moments[index];
            moments[index].1 = motion.smoothed(&later, seconds(later_ns.saturating_sub(stamp_ns)), acceleration);
        }
        Some(Self { moments, existence, stationary: track.stationary, has_first_support: !track.older, ended_ns: track.ended_ns })
    }

    /// The walker at a time; `None` when there is nothing to say about it.
    pub(crate) fn at(&self, stamp_ns: u64) -> Option<Presence> {
        let after = self.moments.partition_point(|(moment_ns, ..)| *moment_ns <= stamp_ns);
        let Some((before_ns, motion, acceleration)) = after.checked_sub(1).and_then(|before| self.moments.get(before)) else {
            return self.before_first(stamp_ns);
        };
        let since_s = seconds(stamp_ns.saturating_sub(*before_ns));
        match self.moments.get(after) {
            Some((after_ns, later, _)) => {
                // Between two supports: predicted from the one, smoothed by the other.
                let until_s = seconds(after_ns.saturating_sub(stamp_ns));
                let share = since_s / (since_s + until_s).max(1e-9);
                let mean = motion.predict(since_s, 0.0).mean * (1.0 - share) + later.predict(-until_s, 0.0).mean * share;
                let covariance = motion.covariance * (1.0 - share) + later.covariance * share;
                let bridge = Motion { mean, covariance };
                let gap_s = since_s.min(until_s);
                let existence = if self.stationary { 1.0 } else { faded(gap_s) };
                Some(Presence { motion: widened(&bridge, gap_s, *acceleration), existence: self.existence * existence })
            }
            None => {
                if self.ended_ns.is_some_and(|ended_ns| stamp_ns > ended_ns) {
                    return None;
                }
                let existence = self.existence * if self.stationary { HELD } else { faded(since_s) };
                Some(Presence { motion: motion.predict(since_s, *acceleration), existence })
            }
        }
    }

    /// Back-dated: a walker was somewhere before the first sight.
    fn before_first(&self, stamp_ns: u64) -> Option<Presence> {
        let (first_ns, first, _) = self.moments.first().filter(|_| self.has_first_support)?;
        let until_s = seconds(first_ns.saturating_sub(stamp_ns));
        let stood = first.velocity_m_s().norm() < STOOD_M_S;
        let motion = if stood { *first } else { first.predict(-until_s, ACCELERATION) };
        Some(Presence { motion, existence: self.existence * BACK_DATED * faded(until_s) })
    }
}

fn widened(motion: &Motion, gap_s: f64, acceleration: f64) -> Motion {
    let mut wider = *motion;
    for axis in 0..2 {
        wider.covariance[(axis, axis)] += acceleration * gap_s.powi(3) / 3.0;
    }
    wider
}

fn faded(gap_s: f64) -> f64 {
    (-(gap_s - FRESH_S).max(0.0) / FADE_S).exp()
}
