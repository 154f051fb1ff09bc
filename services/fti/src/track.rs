//! One walker: a Kalman filter in the map frame, and what supports it.

use geometry::Beam;
use messages::{Pose, seconds};
use nalgebra::{Vector2, Vector4};
use postcard_schema::Schema;
use serde::{Deserialize, Serialize};
use state::Queue;
use tracking::{Measured, Motion};

use crate::observe::{SonarEcho, ranged, sighted};
use crate::sight::Sight;

/// White acceleration of a walker, m²/s³.
/// Half: 86.9 % / 1.46 %, twice: 85.4 % / 1.58 %.
pub(crate) const ACCELERATION: f64 = 1.2;
/// Of a stationary walker, who shifts the weight from foot to foot, m²/s³.
/// Half: 85.1 % / 1.32 %, twice: 84.8 % / 1.35 %.
const STANDING: f64 = 0.02;
/// By how much the place of a stationary walker grows uncertain, m²/s.
/// Half: 84.8 % / 1.35 %, twice: 84.7 % / 1.39 %.
const SWAY_M2_S: f64 = 0.008;
/// Walkers are not faster indoors, m/s.
/// Half: 85.1 % / 1.26 %, twice: 85.2 % / 1.24 %.
const MOST_SPEED_M_S: f64 = 1.7;
/// Hits that confirm a track.
/// Half: 86.8 % / 1.73 %, twice: 83.6 % / 1.22 %.
const CONFIRMING_HITS: u32 = 8;
/// Rest is judged by the distance moved in this time, ns.
/// Half: 86.3 % / 1.51 %, twice: 83.6 % / 1.20 %.
const REST_NS: u64 = 600_000_000;
/// A walker that moved less than this in that time rests, m.
/// Half: 83.9 % / 1.18 %, twice: 86.3 % / 1.46 %.
const REST_M: f64 = 0.15;
/// A stationary walker stays within a step: an echo farther off is of another walker or of the wall, m.
/// Half: 84.5 % / 1.31 %, twice: 84.5 % / 1.57 %.
const STANDS_M: f64 = 0.2;
/// Half of a body's width, m.
/// Half: 81.5 % / 1.23 %, twice: 87.2 % / 1.49 %.
const BODY_HALF_M: f64 = 0.2;
/// What lies farther before a walker than this hides the walker, m.
/// Half: 85.0 % / 1.35 %, twice: 85.0 % / 1.34 %.
const BEFORE_M: f64 = 0.3;
/// A reading that goes so far beyond a walker shows that the walker is gone, m.
/// Half: 85.0 % / 1.34 %, twice: 84.9 % / 1.36 %.
const PASS_M: f64 = 0.45;
/// Echoes that began with a walker are of that walker from so many on: more than a second of them.
/// Half: 86.1 % / 1.47 %, twice: 83.8 % / 1.32 %.
const LEFT_ECHOES: u32 = 4;
/// A walker faster than this at the last of them walks on, and does not stand, m/s.
/// Half: 81.5 % / 1.31 %, twice: 86.1 % / 1.33 %.
const LEFT_SPEED_M_S: f64 = 0.6;
/// Two stationary walkers closer than this are one, m.
/// Half: 84.7 % / 1.43 %, twice: 83.2 % / 1.29 %.
const SAME_M: f64 = 0.4;

/// Who saw the track first.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub(crate) enum Origin {
    Camera,
    /// STD alone.
    Sonar,
}

/// Echoes of one sonar that began with a walker.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, Schema)]
pub(crate) struct Anchor {
    /// Their run.
    pub(crate) run: u64,
    /// How many the walker explained.
    pub(crate) echoes: u32,
    /// The walker at the last of them.
    pub(crate) motion: Motion,
    pub(crate) stamp_ns: u64,
}

/// What was believed after a support.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, Schema)]
pub(crate) struct Posterior {
    pub(crate) stamp_ns: u64,
    pub(crate) motion: Motion,
    /// White acceleration until the next one.
    pub(crate) acceleration: f64,
}

/// A track this far from its first sight has walked, m.
/// Half: 85.0 % / 1.36 %, twice: 83.9 % / 1.35 %.
const WALKED_M: f64 = 0.6;

/// One walker.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, Schema)]
pub(crate) struct Track {
    pub(crate) id: u64,
    pub(crate) origin: Origin,
    pub(crate) hits: u32,
    pub(crate) motion: Motion,
    /// Time of `motion`.
    pub(crate) stamp_ns: u64,
    /// Last support by a blob.
    pub(crate) seen_ns: u64,
    /// Last support by an echo; 0: none.
    pub(crate) echo_ns: u64,
    /// For how long it should have been visible and was not, ns.
    pub(crate) unseen_ns: u64,
    /// Readings that passed beyond it since the last echo.
    pub(crate) passed: u32,
    /// Readings towards it since the last echo that were none of it.
    pub(crate) missed: u32,
    /// Its blob faded while it rested: echoes alone support it.
    pub(crate) stationary: bool,
    /// When it ended.
    pub(crate) ended_ns: Option<u64>,
    /// What was believed at each support within the horizon, the oldest first.
    pub(crate) history: Queue<Posterior>,
    /// Frames that could have shown it before it was certain.
    pub(crate) opportunities: u32,
    /// It was hit often enough, and in most frames.
    pub(crate) is_confirmed: bool,
    /// Where it was first seen, map frame, m.
    pub(crate) first_m: [f64; 2],
    /// It has been seen to walk: what never did is no walker who stopped.
    pub(crate) walked: bool,
    /// Its first support has left the history.
    pub(crate) older: bool,
    /// Where echoes that began with this walker last supported it.
    pub(crate) anchors: Vec<Anchor>,
}

impl Track {
    pub(crate) fn new(id: u64, origin: Origin, motion: Motion, stamp_ns: u64) -> Self {
        let mut track = Self {
            id,
            origin,
            hits: 1,
            motion,
            stamp_ns,
            seen_ns: stamp_ns,
            echo_ns: 0,
            unseen_ns: 0,
            passed: 0,
            missed: 0,
            stationary: false,
            ended_ns: None,
            history: Queue::default(),
            opportunities: 1,
            is_confirmed: false,
            first_m: motion.place_m().into(),
            walked: false,
            older: false,
            anchors: Vec::new(),
        };
        track.remember();
        track
    }

    /// Whether it is a walker for certain.
    pub(crate) fn confirmed(&self) -> bool {
        self.is_confirmed
    }

    /// Last support of any kind, ns.
    pub(crate) fn supported_ns(&self) -> u64 {
        self.seen_ns.max(self.echo_ns)
    }

    fn acceleration(&self) -> f64 {
        if self.stationary { STANDING } else { ACCELERATION }
    }

    /// Goes on to a later time.
    pub(crate) fn predict(&mut self, stamp_ns: u64) {
        let dt_s = seconds(stamp_ns.saturating_sub(self.stamp_ns));
        if self.stationary {
            // A walker that rests does not walk; its place is known less and less.
            for axis in 0..2 {
                self.motion.covariance[(axis, axis)] += SWAY_M2_S * dt_s;
            }
        } else {
            self.motion = self.motion.predict(dt_s, ACCELERATION);
        }
        self.stamp_ns = self.stamp_ns.max(stamp_ns);
    }

    /// Takes in measurements of the time it was predicted to.
    fn update(&mut self, measured: &Measured) {
        self.motion = self.motion.update(measured);
        let velocity = self.motion.velocity_m_s();
        let speed = velocity.norm();
        if speed > MOST_SPEED_M_S {
            let slower = velocity * (MOST_SPEED_M_S / speed);
            self.motion.mean = Vector4::new(self.motion.mean.x, self.motion.mean.y, slower.x, slower.y);
        }
    }

    /// Keeps what is believed now, after a support.
    fn remember(&mut self) {
        let posterior = Posterior { stamp_ns: self.stamp_ns, motion: self.motion, acceleration: self.acceleration() };
        let most = f64::from(self.hits) >= 0.6 * f64::from(self.opportunities) || self.origin == Origin::Sonar;
        self.is_confirmed |= f64::from(self.hits) >= f64::from(CONFIRMING_HITS) && most;
        self.walked |= (self.motion.place_m() - Vector2::from(self.first_m)).norm() > WALKED_M;
        match self.history.back_mut() {
            Some(last) if last.stamp_ns == self.stamp_ns => *last = posterior,
            _ => self.history.push_back(posterior),
        }
    }

    /// Drops what was believed before a time; the last of it stays, to begin from.
    pub(crate) fn forget(&mut self, before_ns: u64) {
        while self.history.get(1).is_some_and(|next| next.stamp_ns < before_ns) {
            self.history.pop_front();
            self.older = true;
        }
    }

    /// Whether it made no way lately. The velocity is noise once the blob is gone.
    pub(crate) fn rests(&self) -> bool {
        let since_ns = self.stamp_ns.saturating_sub(REST_NS);
        let Some(then) = self.history.iter().rev().find(|posterior| posterior.stamp_ns <= since_ns) else { return false };
        let Some(last) = self.history.back() else { return false };
        (last.motion.place_m() - then.motion.place_m()).norm() < REST_M
    }

    /// A stationary walker where this one was, supported by echoes alone from now on.
    pub(crate) fn stationary_at(&self, id: u64, motion: Motion) -> Self {
        let mut stationary_track = self.clone();
        stationary_track.motion = motion;
        stationary_track.anchors.clear();
        stationary_track.id = id;
        stationary_track.stand_still();
        stationary_track.remember();
        stationary_track
    }

    fn stand_still(&mut self) {
        self.stationary = true;
        (self.passed, self.missed) = (0, 0);
        self.motion.mean = Vector4::new(self.motion.mean.x, self.motion.mean.y, 0.0, 0.0);
        for axis in 2..4 {
            for other in 0..4 {
                self.motion.covariance[(axis, other)] = 0.0;
                self.motion.covariance[(other, axis)] = 0.0;
            }
            self.motion.covariance[(axis, axis)] = 0.01;
        }
    }

    pub(crate) fn chi_squared(&self, map_from_camera: &Pose, sight: &Sight) -> f64 {
        let (bearing, depth) = sighted(&self.motion, map_from_camera, sight, false);
        let term = |m: &Measured| m.residual * m.residual / self.motion.innovation_variance(m);
        term(&bearing) + depth.as_ref().map_or(0.0, term)
    }

    pub(crate) fn support_by_sight(&mut self, map_from_camera: &Pose, sight: &Sight, merged: bool, stamp_ns: u64) {
        let (bearing, _) = sighted(&self.motion, map_from_camera, sight, merged);
        self.update(&bearing);
        if let (_, Some(depth)) = sighted(&self.motion, map_from_camera, sight, merged) {
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
        let (measured, aside_m) = ranged(&self.motion, beam)?;
        (aside_m <= BODY_HALF_M).then(|| measured.residual / self.motion.innovation_variance(&measured).sqrt())
    }

    /// Whether an echo comes from where this one stands.
    pub(crate) fn stands_at(&self, beam: &Beam) -> bool {
        ranged(&self.motion, beam).is_some_and(|(measured, aside_m)| aside_m <= BODY_HALF_M && measured.residual.abs() < STANDS_M)
    }

    pub(crate) fn support_by_echo(&mut self, beam: &Beam, stamp_ns: u64) {
        if let Some((measured, _)) = ranged(&self.motion, beam) {
            self.update(&measured);
        }
        if self.origin == Origin::Sonar {
            self.hits = self.hits.saturating_add(1);
        }
        self.echo_ns = stamp_ns;
        (self.passed, self.missed) = (0, 0);
        self.remember();
    }

    pub(crate) fn note_passing(&mut self, beam: &Beam, stamp_ns: u64) {
        let place = self.motion.place_m();
        let seen = beam.see(place.x, place.y);
        if beam.covers(seen) && self.echo_ns != stamp_ns {
            self.passed = self.passed.saturating_add(u32::from(beam.range_m() > seen.z_m() + PASS_M));
            self.missed = self.missed.saturating_add(u32::from(beam.range_m() > seen.z_m() - BEFORE_M));
        }
    }

    /// Notes an echo that supported it, if it belongs to a run that began with it.
    pub(crate) fn anchor(&mut self, echo: &SonarEcho<'_>, stamp_ns: u64) {
        let (motion, run) = (self.motion, echo.run);
        match self.anchors.iter_mut().find(|anchor| anchor.run == run) {
            Some(anchor) => *anchor = Anchor { run, echoes: anchor.echoes.saturating_add(1), motion, stamp_ns },
            None if echo.first => self.anchors.push(Anchor { run, echoes: 1, motion, stamp_ns }),
            None => {}
        }
    }

    /// A stationary walker where an echo came from that began with this track and supports it no longer.
    pub(crate) fn left_behind(&self, echo: &SonarEcho<'_>, stamp_ns: u64) -> Option<Self> {
        let anchor = self.anchors.iter().find(|anchor| anchor.run == echo.run && anchor.stamp_ns < stamp_ns)?;
        if anchor.echoes < LEFT_ECHOES || anchor.motion.velocity_m_s().norm() > LEFT_SPEED_M_S {
            return None;
        }
        let mut stationary_track = self.stationary_at(0, anchor.motion);
        (stationary_track.stamp_ns, stationary_track.echo_ns, stationary_track.ended_ns) = (stamp_ns, stamp_ns, None);
        stationary_track.remember();
        stationary_track.stands_at(echo.beam).then_some(stationary_track)
    }

    /// Whether this is a stationary walker where another stands.
    pub(crate) fn stands_near(&self, other: &Self) -> bool {
        self.stationary && self.ended_ns.is_none() && (self.motion.place_m() - other.motion.place_m()).norm() < SAME_M
    }
}
