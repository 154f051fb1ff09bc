//! All walkers: whose a blob is, birth and end.

use messages::{CameraMotion, CameraStatus, Pose};
use nalgebra::Vector2;
use serde::{Deserialize, Serialize};
use tracking::Motion;

use crate::parameters::Camera;
use crate::sight::{Estimate, Sight, View};
use crate::track::{Origin, Track};

/// Association: χ² of a pair that may be one (two degrees of freedom).
const GATE: f64 = 11.0;
/// Spread of a first velocity, m/s.
pub(crate) const SPEED_SD_M_S: f64 = 0.8;
/// A tentative track that is not seen again for as long as this was false, ns.
const TENTATIVE_NS: u64 = 400_000_000;
/// A track that should be visible and is not ends after this time, ns.
pub(crate) const UNSEEN_NS: u64 = 1_000_000_000;
/// A walker out of view is followed for this time, ns. Echoes do not prolong it: there are always some, of walls.
pub(crate) const COAST_NS: u64 = 3_000_000_000;
/// The camera sees nobody beyond this, m.
const SIGHT_M: f64 = 6.0;
/// A track this close to the side of the picture may be out of it, rad.
const SIDE_RAD: f64 = 0.05;
/// Most tracks at once.
pub(crate) const MAX_TRACKS: usize = 32;
/// A blob without a distance is taken to be about here, m.
const UNKNOWN_DEPTH: Estimate = Estimate { value: 4.0, variance: 4.0 };

/// All walkers, also those who ended within the horizon.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
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

    /// Leads everybody on to this time. Whoever was followed before a long pause may be anywhere: he is followed no longer.
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
            track.chances = track.chances.saturating_add(1);
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
        let alive = || self.tracks.iter().enumerate().filter(|(_, track)| track.ended_ns.is_none() && !track.held);
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

    /// New tracks from blobs that are nobody's and no fragments.
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
            } else if track.unseen_ns > UNSEEN_NS && !track.held {
                track.ended_ns = Some(track.supported_ns());
            }
        }
    }

    /// Forgets what lies before the horizon.
    pub(crate) fn forget(&mut self, before_ns: u64) {
        self.tracks.retain(|track| track.ended_ns.is_none_or(|ended_ns| ended_ns >= before_ns));
        self.tracks.iter_mut().for_each(|track| track.forget(before_ns));
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

/// Whether the camera should see a walker.
pub(crate) fn in_view(camera: &Camera, map_from_camera: &Pose, motion: &Motion) -> bool {
    let place = motion.place_m();
    let towards = Vector2::new(place.x - map_from_camera.x_m, place.y - map_from_camera.y_m);
    let bearing_rad = wrapped(towards.y.atan2(towards.x) - map_from_camera.yaw_rad);
    bearing_rad.abs() < camera.field_of_view_rad / 2.0 - SIDE_RAD && towards.norm() < SIGHT_M
}

fn wrapped(angle_rad: f64) -> f64 {
    angle_rad.sin().atan2(angle_rad.cos())
}
