//! Tracks of moving classes: nearest neighbour with a gate, constant velocity.

use messages::seconds;
use nalgebra::{Matrix2, Vector2, Vector4};
use postcard_schema::Schema;
use serde::{Deserialize, Serialize};
use state::Queue;
use tracking::{Measured, Motion};

/// A walker's legs change speed with every step; density of the white acceleration, m²/s³.
const ACCELERATION: f64 = 1.2;
/// The centroid of an arc against the middle of a body: half the arc's width at 2 m, m.
const CENTROID_SD_M: f64 = 0.25;
/// Spread of walking speeds in one direction, m/s.
const SPEED_SD_M_S: f64 = 0.8;
/// A class farther than this from where a track is expected is another thing, m.
const GATE_M: f64 = 0.8;
/// A track that no class supports for as long as this has ended, ns: three firing cycles.
const END_NS: u64 = 900_000_000;
/// Most tracks at once; a robot among more sees none of them apart.
const MAX_TRACKS: usize = 32;

/// One moving thing over time.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, Schema)]
pub struct Track {
    /// Its identity, from 1; never used again in a run.
    pub id: u64,
    /// Place and velocity in the map frame at the last support.
    pub motion: Motion,
    /// Time of its last support.
    pub stamp_ns: u64,
    /// Its centroids in the map frame over the time span τ, m, each with its scan, the oldest first.
    pub trajectory: Queue<(u32, [f64; 2])>,
}

/// The tracks that are alive.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, Schema)]
pub(crate) struct Tracks {
    tracks: Vec<Track>,
    /// Identities given so far.
    given: u64,
}

/// What a mover's track says of it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Tracked {
    pub(crate) id: u64,
    pub(crate) velocity_m_s: Vector2<f64>,
}

impl Tracks {
    /// Ends every track. Identities stay used.
    pub(crate) fn clear(&mut self) {
        self.tracks.clear();
    }

    pub(crate) fn alive(&self) -> &[Track] {
        &self.tracks
    }

    /// Tells each of a scan's centroids, in m of the map frame, which track it belongs to; takes them in.
    pub(crate) fn follow(&mut self, scan: u32, span_scans: u32, stamp_ns: u64, centroids_m: &[Vector2<f64>]) -> Vec<Tracked> {
        self.tracks.retain(|track| stamp_ns.saturating_sub(track.stamp_ns) <= END_NS);
        let mut owners: Vec<Option<usize>> = vec![None; centroids_m.len()];
        for (_, track, centroid) in self.pairs(stamp_ns, centroids_m) {
            if owners.get(centroid) == Some(&None) && !owners.contains(&Some(track)) {
                owners[centroid] = Some(track);
            }
        }
        let mut tracked = Vec::with_capacity(centroids_m.len());
        for (centroid_m, owner) in centroids_m.iter().zip(owners) {
            let index = owner.or_else(|| self.start(stamp_ns, *centroid_m));
            let known =
                index.and_then(|index| self.tracks.get_mut(index)).map(|track| track.support(scan, span_scans, stamp_ns, *centroid_m));
            tracked.push(known.unwrap_or(Tracked { id: 0, velocity_m_s: Vector2::zeros() }));
        }
        tracked
    }

    /// Track and centroid of every pair within the gate, nearest first.
    fn pairs(&self, stamp_ns: u64, centroids_m: &[Vector2<f64>]) -> Vec<(f64, usize, usize)> {
        let mut pairs = Vec::new();
        for (index, track) in self.tracks.iter().enumerate() {
            let expected_m = track.expected(stamp_ns).place_m();
            for (centroid, centroid_m) in centroids_m.iter().enumerate() {
                let distance_m = (centroid_m - expected_m).norm();
                if distance_m < GATE_M {
                    pairs.push((distance_m, index, centroid));
                }
            }
        }
        pairs.sort_by(|a, b| a.0.total_cmp(&b.0));
        pairs
    }

    fn start(&mut self, stamp_ns: u64, place_m: Vector2<f64>) -> Option<usize> {
        if self.tracks.len() >= MAX_TRACKS {
            return None;
        }
        self.given += 1;
        let place_covariance = Matrix2::identity() * (CENTROID_SD_M * CENTROID_SD_M);
        let motion = Motion::at(place_m, place_covariance, SPEED_SD_M_S);
        self.tracks.push(Track { id: self.given, motion, stamp_ns, trajectory: Queue::default() });
        Some(self.tracks.len() - 1)
    }
}

impl Track {
    fn expected(&self, stamp_ns: u64) -> Motion {
        self.motion.predict(seconds(stamp_ns.saturating_sub(self.stamp_ns)), ACCELERATION)
    }

    fn support(&mut self, scan: u32, span_scans: u32, stamp_ns: u64, place_m: Vector2<f64>) -> Tracked {
        let mut motion = self.expected(stamp_ns);
        for (row, axis) in [(Vector4::x(), 0), (Vector4::y(), 1)] {
            let residual = place_m[axis] - motion.mean[axis];
            motion = motion.update(&Measured { row, residual, variance: CENTROID_SD_M * CENTROID_SD_M });
        }
        self.motion = motion;
        self.stamp_ns = stamp_ns;
        self.trajectory.push_back((scan, [place_m.x, place_m.y]));
        while self.trajectory.front().is_some_and(|(old, _)| scan.saturating_sub(*old) > span_scans) {
            self.trajectory.pop_front();
        }
        Tracked { id: self.id, velocity_m_s: motion.velocity_m_s() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SPAN: u32 = 4;

    /// Follows places at 10 scans a second; the identities of each scan.
    fn follow(scans: &[&[[f64; 2]]]) -> (Tracks, Vec<Vec<u64>>) {
        let mut tracks = Tracks::default();
        let ids = (1u32..).zip(scans).map(|(scan, places)| {
            let places: Vec<Vector2<f64>> = places.iter().map(|p| Vector2::from(*p)).collect();
            tracks.follow(scan, SPAN, u64::from(scan) * 100_000_000, &places).iter().map(|t| t.id).collect()
        });
        let ids = ids.collect();
        (tracks, ids)
    }

    #[test]
    fn a_walker_keeps_its_identity_and_its_velocity_is_found() {
        let places: Vec<[[f64; 2]; 1]> = (0..20).map(|i| [[2.0, 0.1 * f64::from(i)]]).collect();
        let scans: Vec<&[[f64; 2]]> = places.iter().map(|p| p.as_slice()).collect();
        let (tracks, ids) = follow(&scans);
        assert!(ids.iter().all(|ids| ids == &[1]));
        let velocity = tracks.alive()[0].motion.velocity_m_s();
        assert!((velocity - Vector2::new(0.0, 1.0)).norm() < 0.1, "{velocity}");
        assert_eq!(tracks.alive()[0].trajectory.len(), SPAN as usize + 1);
    }

    #[test]
    fn the_nearer_place_takes_the_track_and_the_other_starts_one() {
        let (_, ids) = follow(&[&[[1.0, 0.0]], &[[1.5, 0.0], [1.1, 0.0]]]);
        assert_eq!(ids, [vec![1], vec![2, 1]]);
    }

    #[test]
    fn a_track_ends_when_nothing_supports_it() {
        let silence: &[[f64; 2]] = &[];
        let mut scans = vec![silence; 12];
        let place = [[1.0, 0.0]];
        scans[0] = &place;
        scans[11] = &place;
        assert_eq!(follow(&scans).1[11], [2]);
    }
}
