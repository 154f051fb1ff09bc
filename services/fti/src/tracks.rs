//! All walkers: whose a blob or an echo is, birth and end.

use geometry::wrapped;
use messages::{CameraMotion, CameraStatus, Mover, Pose};
use nalgebra::{Matrix2, Vector2};
use postcard_schema::Schema;
use serde::{Deserialize, Serialize};
use tracking::Motion;

use crate::gating::{in_view, is_fresh};
use crate::observe::SonarEcho;
use crate::parameters::{Camera, Parameters};
use crate::sight::{Estimate, Sight, View};
use crate::track::{Origin, Track};

/// Association: χ² of a pair that may be one (two degrees of freedom).
/// Half: 86.0 % / 1.50 %, twice: 83.9 % / 1.20 %.
const GATE: f64 = 11.0;
/// Spread of a first velocity, m/s.
/// Half: 84.8 % / 1.34 %, twice: 85.1 % / 1.36 %.
const SPEED_SD_M_S: f64 = 0.8;
/// A tentative track that is not seen again for as long as this was false, ns.
/// Half: 84.9 % / 1.33 %, twice: 85.0 % / 1.35 %.
const TENTATIVE_NS: u64 = 400_000_000;
/// A track that should be visible and is not ends after this time, ns.
/// Half: 84.1 % / 1.21 %, twice: 85.0 % / 2.05 %.
const UNSEEN_NS: u64 = 1_000_000_000;
/// A walker out of view is followed for this time, ns. Echoes do not prolong it: there are always some, of walls.
/// Half: 84.2 % / 1.08 %, twice: 85.0 % / 1.28 %.
const COAST_NS: u64 = 3_000_000_000;
/// Most tracks at once.
const MAX_TRACKS: usize = 32;
/// A blob without a distance is taken to be about here, m.
const UNKNOWN_DEPTH: Estimate = Estimate { value: 4.0, variance: 4.0 };

/// An echo supports a track within this many standard deviations.
/// Half: 86.9 % / 1.16 %, twice: 85.3 % / 1.64 %.
const ECHO_GATE: f64 = 2.5;
/// S from which on an echo is a known wall's.
/// Half: 84.8 % / 1.31 %, twice: 84.8 % / 1.39 %.
const KNOWN_WALL: f64 = 1.5;
/// A slower walker may stand before a wall, m/s.
/// Half: 84.8 % / 1.35 %, twice: 85.1 % / 1.35 %.
const SLOW_M_S: f64 = 0.35;
/// A stationary track ends this long after the last echo, ns: so long a robot may look elsewhere and come to pass.
/// Half: 85.0 % / 1.31 %, twice: 85.0 % / 1.41 %.
const HELD_NS: u64 = 10_000_000_000;
/// Or when this many readings pass beyond it.
/// Half: 84.5 % / 1.31 %, twice: 84.8 % / 1.39 %.
const PASSES: u32 = 2;
/// Or this many that look at it and are of something else.
/// Half: 84.8 % / 1.33 %, twice: 85.0 % / 1.36 %.
const MISSES: u32 = 5;
/// A walker was seen to come to rest: the blob fades a moment later, ns.
/// Half: 84.9 % / 1.17 %, twice: 85.0 % / 1.51 %.
const SEEN_NS: u64 = 1_000_000_000;
/// Echoes of a walker are compared with the walker again within this time, ns.
/// It bounds the memory of a track. Half or twice of it gives the same verdicts.
const ANCHOR_NS: u64 = 1_000_000_000;

/// All walkers, also those who ended within the horizon.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, Schema)]
pub(crate) struct Tracks {
    pub(crate) tracks: Vec<Track>,
    /// Identities given so far.
    pub(crate) given: u64,
    /// Time of the last frame whose blobs count; 0: none.
    pub(crate) frame_ns: u64,
}

impl Tracks {
    pub(crate) fn alive(&mut self) -> impl Iterator<Item = &mut Track> {
        self.tracks.iter_mut().filter(|track| track.ended_ns.is_none())
    }

    /// Predicts every track to this time. After a long pause a walker may be anywhere: the track ends.
    pub(crate) fn lead(&mut self, stamp_ns: u64) {
        for track in self.alive() {
            if stamp_ns.saturating_sub(track.stamp_ns) > COAST_NS {
                track.ended_ns = Some(track.supported_ns());
            } else {
                track.predict(stamp_ns);
            }
        }
    }

    /// The blobs of a frame, taken from a robot at `map_from_robot`.
    pub(crate) fn see(&mut self, camera: &Camera, map_from_robot: &Pose, stamp_ns: u64, frame: &CameraMotion) {
        let Some(view) = View::new(camera, frame).filter(|_| frame.status == CameraStatus::Compensated as u32) else { return };
        let map_from_camera = map_from_robot.then(&camera.mount);
        let since_ns = if self.frame_ns == 0 { 0 } else { stamp_ns.saturating_sub(self.frame_ns) };
        self.frame_ns = stamp_ns;
        self.lead(stamp_ns);
        let sights: Vec<Sight> = frame.blobs().iter().map(|blob| view.sight(blob)).collect();
        let owners = self.associate(&map_from_camera, &sights);
        let in_view = |motion: &Motion| in_view(camera, &map_from_camera, motion);
        for (index, track) in self.tracks.iter_mut().enumerate().filter(|(_, track)| track.ended_ns.is_none()) {
            track.opportunities = track.opportunities.saturating_add(1);
            if let Some(blob) = owners.iter().position(|owners| owners.contains(&index)) {
                let merged = owners.get(blob).is_some_and(|owners| owners.len() > 1);
                if let Some(sight) = sights.get(blob) {
                    track.support_by_sight(&map_from_camera, sight, merged, stamp_ns);
                }
            } else if in_view(&track.motion) {
                track.unseen_ns += since_ns;
            }
        }
        self.start_from(&map_from_camera, &sights, &owners, stamp_ns);
        self.end_unseen(stamp_ns);
    }

    /// For each blob the tracks that lie in it.
    fn associate(&self, map_from_camera: &Pose, sights: &[Sight]) -> Vec<Vec<usize>> {
        let origin = Vector2::new(map_from_camera.x_m, map_from_camera.y_m);
        let alive = || self.tracks.iter().enumerate().filter(|(_, track)| track.ended_ns.is_none() && !track.stationary);
        let mut pairs = Vec::new();
        for (index, track) in alive() {
            for (blob, sight) in sights.iter().enumerate() {
                let chi_squared = track.chi_squared(map_from_camera, sight);
                // Certain tracks choose first.
                if chi_squared < GATE && (track.confirmed() || sight.upright) {
                    pairs.push((!track.confirmed(), chi_squared, index, blob));
                }
            }
        }
        pairs.sort_by(|a, b| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)));
        let mut owners: Vec<Vec<usize>> = vec![Vec::new(); sights.len()];
        for (_, _, index, blob) in pairs {
            let taken = owners.iter().any(|owners| owners.contains(&index));
            if let Some(owners) = owners.get_mut(blob).filter(|owners| owners.is_empty() && !taken) {
                owners.push(index);
            }
        }
        // Merged silhouettes: a certain track without a blob of its own that lies in another's.
        for (index, track) in alive().filter(|(_, track)| track.confirmed()) {
            if owners.iter().any(|owners| owners.contains(&index)) {
                continue;
            }
            let towards = track.motion.place_m() - origin;
            let bearing_rad = wrapped(towards.y.atan2(towards.x) - map_from_camera.yaw_rad);
            let within = |sight: &Sight| (sight.extent_rad[1]..=sight.extent_rad[0]).contains(&bearing_rad);
            if let Some(owners) =
                sights.iter().zip(&mut owners).find(|(sight, owners)| within(sight) && !owners.is_empty()).map(|(_, owners)| owners)
            {
                owners.push(index);
            }
        }
        owners
    }

    /// New tracks from blobs that belong to no track and are no fragments.
    fn start_from(&mut self, map_from_camera: &Pose, sights: &[Sight], owners: &[Vec<usize>], stamp_ns: u64) {
        let overlaps = |a: &Sight, b: &Sight| a.extent_rad[1] < b.extent_rad[0] && b.extent_rad[1] < a.extent_rad[0];
        let mut used: Vec<&Sight> = sights.iter().zip(owners).filter(|(_, owners)| !owners.is_empty()).map(|(sight, _)| sight).collect();
        for (sight, _) in sights.iter().zip(owners).filter(|(sight, owners)| owners.is_empty() && sight.upright) {
            if !used.iter().any(|other| overlaps(sight, other)) {
                self.start(Origin::Camera, place_of(map_from_camera, sight), stamp_ns);
                used.push(sight);
            }
        }
    }

    pub(crate) fn start(&mut self, origin: Origin, motion: Motion, stamp_ns: u64) {
        if self.tracks.len() < MAX_TRACKS {
            self.given += 1;
            self.tracks.push(Track::new(self.given, origin, motion, stamp_ns));
        }
    }

    fn end_unseen(&mut self, stamp_ns: u64) {
        for track in self.alive() {
            let tentative =
                !track.confirmed() && track.origin == Origin::Camera && stamp_ns.saturating_sub(track.supported_ns()) > TENTATIVE_NS;
            if tentative {
                track.ended_ns = Some(stamp_ns);
            } else if track.unseen_ns > UNSEEN_NS && !track.stationary {
                track.ended_ns = Some(track.supported_ns());
            }
        }
    }

    /// Forgets what lies before the horizon.
    pub(crate) fn forget(&mut self, before_ns: u64) {
        self.tracks.retain(|track| track.ended_ns.is_none_or(|ended_ns| ended_ns >= before_ns));
        self.tracks.iter_mut().for_each(|track| track.forget(before_ns));
    }

    /// The echoes and movers of a scan.
    pub(crate) fn update_by_sonar(
        &mut self,
        parameters: &Parameters,
        map_from_robot: &Pose,
        stamp_ns: u64,
        echoes: &[SonarEcho<'_>],
        movers: &[Mover],
    ) {
        self.lead(stamp_ns);
        let mut claimed = vec![false; echoes.len()];
        for (echo, claimed) in echoes.iter().zip(&mut claimed).filter(|(echo, _)| echo.beam.echo()) {
            *claimed = self.support_by_echo(echo, stamp_ns);
        }
        for echo in echoes {
            for track in self.alive().filter(|track| track.stationary) {
                track.note_passing(echo.beam, stamp_ns);
            }
        }
        for mover in movers {
            let known = echoes.iter().zip(&claimed).enumerate().any(|(index, (_, claimed))| *claimed && mover.readings & (1 << index) != 0);
            if !known {
                self.support_or_start_by_mover(parameters, map_from_robot, stamp_ns, mover);
            }
        }
        self.note_left_behind(echoes, stamp_ns);
        self.note_stationary(stamp_ns);
        self.end_silent(stamp_ns);
    }

    /// Gives an echo to the track that explains it best and to a stationary one there; whether there is one.
    fn support_by_echo(&mut self, echo: &SonarEcho<'_>, stamp_ns: u64) -> bool {
        let known_wall = echo.past > KNOWN_WALL;
        let mut standing = false;
        for track in self.alive().filter(|track| track.stationary && !known_wall) {
            if track.stands_at(echo.beam) {
                track.support_by_echo(echo.beam, stamp_ns);
                standing = true;
            }
        }
        let walking = self.alive().filter(|track| !track.stationary && (track.confirmed() || track.origin == Origin::Sonar));
        let near = walking.filter_map(|track| {
            let deviation = track.echo_deviation(echo.beam)?.abs();
            let plausible = !known_wall || track.walked && track.motion.velocity_m_s().norm() < SLOW_M_S;
            (deviation < ECHO_GATE && plausible).then_some((deviation, track))
        });
        match near.min_by(|a, b| a.0.total_cmp(&b.0)) {
            Some((_, track)) => {
                track.support_by_echo(echo.beam, stamp_ns);
                track.anchor(echo, stamp_ns);
                true
            }
            None => standing,
        }
    }

    /// Where a walker with echoes comes to rest is a stationary one, who may fade from the picture and be passed by others.
    fn note_stationary(&mut self, stamp_ns: u64) {
        let resting: Vec<usize> = (0..self.tracks.len())
            .filter(|index| {
                let Some(track) = self.tracks.get(*index) else { return false };
                let rests = track.ended_ns.is_none()
                    && !track.stationary
                    && track.confirmed()
                    && track.walked
                    && track.echo_ns == stamp_ns
                    && stamp_ns.saturating_sub(track.seen_ns) <= SEEN_NS
                    && track.rests();
                rests && !self.tracks.iter().any(|other| other.stands_near(track))
            })
            .collect();
        for index in resting {
            if self.tracks.len() < MAX_TRACKS
                && let Some(track) = self.tracks.get(index)
            {
                self.given += 1;
                let stationary_track = track.stationary_at(self.given, track.motion);
                self.tracks.push(stationary_track);
            }
        }
    }

    /// Echoes that began with a walker and continue at their place when the track has left it: the walker stands there, and the
    /// track follows another one who passed.
    fn note_left_behind(&mut self, echoes: &[SonarEcho<'_>], stamp_ns: u64) {
        let mut stationary_tracks: Vec<Track> = Vec::new();
        for echo in echoes.iter().filter(|echo| echo.beam.echo() && echo.past <= KNOWN_WALL) {
            for track in self.tracks.iter().filter(|track| track.confirmed() && track.walked && !track.stationary) {
                let Some(stationary_track) = track.left_behind(echo, stamp_ns) else { continue };
                if !self.tracks.iter().chain(&stationary_tracks).any(|other| other.stands_near(&stationary_track)) {
                    stationary_tracks.push(stationary_track);
                }
            }
        }
        for mut stationary_track in stationary_tracks.into_iter().take(MAX_TRACKS.saturating_sub(self.tracks.len())) {
            self.given += 1;
            stationary_track.id = self.given;
            self.tracks.push(stationary_track);
        }
        for track in &mut self.tracks {
            track.anchors.retain(|anchor| stamp_ns.saturating_sub(anchor.stamp_ns) < ANCHOR_NS);
        }
    }

    /// A mover that only STD sees, where the camera does not look.
    fn support_or_start_by_mover(&mut self, parameters: &Parameters, map_from_robot: &Pose, stamp_ns: u64, mover: &Mover) {
        let place = Vector2::new(mover.map_x_m, mover.map_y_m);
        let motion = Motion::at(place, Matrix2::identity() * 0.0625, SPEED_SD_M_S);
        let watched = parameters.camera.is_some_and(|camera| {
            is_fresh(self.frame_ns, stamp_ns, UNSEEN_NS) && in_view(&camera, &map_from_robot.then(&camera.mount), &motion)
        });
        if !watched {
            self.start(Origin::Sonar, motion, stamp_ns);
        }
    }

    fn end_silent(&mut self, stamp_ns: u64) {
        for track in self.alive() {
            let over = if track.stationary {
                track.passed >= PASSES || track.missed >= MISSES || stamp_ns.saturating_sub(track.echo_ns) > HELD_NS
            } else if track.origin == Origin::Sonar {
                stamp_ns.saturating_sub(track.supported_ns()) > UNSEEN_NS
            } else {
                stamp_ns.saturating_sub(track.seen_ns) > COAST_NS
            };
            if over {
                track.ended_ns = Some(track.supported_ns());
            }
        }
    }
}

fn place_of(map_from_camera: &Pose, sight: &Sight) -> Motion {
    let depth = sight.depth.unwrap_or(UNKNOWN_DEPTH);
    let direction_rad = map_from_camera.yaw_rad + sight.bearing.value;
    let distance_m = depth.value / sight.bearing.value.cos().max(0.1);
    let (sin, cos) = direction_rad.sin_cos();
    let (away, across) = (Vector2::new(cos, sin), Vector2::new(-sin, cos));
    let across_variance = sight.bearing.variance * distance_m * distance_m;
    let covariance = away * away.transpose() * depth.variance + across * across.transpose() * across_variance;
    Motion::at(Vector2::new(map_from_camera.x_m, map_from_camera.y_m) + away * distance_m, covariance, SPEED_SD_M_S)
}
