//! Camera motion made from the truth: what background subtraction would report of the walkers, with its failings.
//!
//! A walker is a silhouette between its outermost columns, from its head to its nearer foot. Walls hide it, other walkers
//! merge with it, the picture cuts it, and it fades when the walker stands. Blobs are missed, fall to pieces and appear where
//! no walker is. The camera is not quite what the robot takes it for.

use messages::{Blob, CameraMotion, CameraStatus, MAX_BLOBS, Pose};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use crate::chance::{normal, of_frame};
use crate::geometry::{Ray, Vector};
use crate::journey::Journey;
use crate::optics::Optics;
use crate::still::Still;
use crate::walker::Walker;
use crate::world::{MAX_WALKERS, World};

/// Height of a walker, m.
const HEIGHT_M: f64 = 1.7;
/// Half of the width of a walker's shoulders, m.
const HALF_WIDTH_M: f64 = 0.22;
/// Radius of a trousered shin, m.
const LEG_M: f64 = 0.07;
/// Nearer than this a walker covers the lens, farther the walker is too small for a blob, m.
const DEPTHS_M: std::ops::Range<f64> = 0.25..8.0;
/// Columns of a silhouette that are looked at one by one.
const COLUMNS: u32 = 9;
/// Who moves slower than this stands, m/s.
const STANDS_M_S: f64 = 0.1;
/// False blobs live this many frames at most.
const FALSE_FRAMES: u64 = 5;
/// Share of a silhouette's box that its pixels fill.
const FILLED: f64 = 0.6;
/// Smaller ones are dropped by background subtraction, px.
const LEAST_PX: f64 = 40.0;

/// How often, and how far, background subtraction fails.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Failings {
    /// Share of blobs that are missed.
    pub missed: f64,
    /// Share of blobs that fall to pieces; of a third of these the feet are lost.
    pub fragments: f64,
    /// False blobs in a frame, on average.
    pub false_blobs: f64,
    /// A walker who stands fades into the background after this time, s.
    pub fades_after_s: f64,
    /// Spread of a blob's edges, px.
    pub edge_px: f64,
    /// The true focal length differs by this share,
    pub focal_share: f64,
    /// the true horizon by so many pixels,
    pub horizon_px: f64,
    /// and the true height of the camera by this, m. The directions are the seed's.
    pub height_m: f64,
}

impl Failings {
    /// Every silhouette as it is, by the camera as it is taken to be.
    pub const NONE: Self = Self {
        missed: 0.0,
        fragments: 0.0,
        false_blobs: 0.0,
        fades_after_s: f64::INFINITY,
        edge_px: 0.0,
        focal_share: 0.0,
        horizon_px: 0.0,
        height_m: 0.0,
    };
}

impl Default for Failings {
    /// What background subtraction on a driving robot is taken to do.
    fn default() -> Self {
        Self {
            missed: 0.08,
            fragments: 0.15,
            false_blobs: 0.2,
            fades_after_s: 0.8,
            edge_px: 1.0,
            focal_share: 0.03,
            horizon_px: 2.0,
            height_m: 0.03,
        }
    }
}

/// The frames of a drive, one by one.
#[derive(Debug, Clone)]
pub struct Blobs {
    still: Still,
    walkers: Vec<Walker>,
    journey: Journey,
    mount: Pose,
    size_px: [f64; 2],
    interval_ns: u64,
    focal_px: f64,
    horizon_px: f64,
    height_m: f64,
    failings: Failings,
    seed: u64,
    /// Frames made so far.
    frames: u64,
    /// When each walker last moved, s.
    moved_s: Vec<f64>,
    /// False blobs and the frame in which each ends.
    spurious: Vec<(u64, Silhouette)>,
}

/// A box in the picture, px, edges not yet cut.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Silhouette {
    left: f64,
    right: f64,
    top: f64,
    bottom: f64,
}

impl Blobs {
    /// Before the first frame.
    #[must_use]
    pub fn new(world: &World, optics: &Optics, failings: &Failings, seed: u64) -> Self {
        let walkers: Vec<Walker> = world.walkers.iter().take(MAX_WALKERS).map(Walker::new).collect();
        let size_px = optics.size_px.map(f64::from);
        let towards = |bit: u64| if seed >> bit & 1 == 0 { 1.0 } else { -1.0 };
        Self {
            still: Still::of(world),
            moved_s: vec![0.0; walkers.len()],
            walkers,
            journey: Journey::of_robot(&world.robot),
            mount: optics.mount,
            size_px,
            interval_ns: optics.interval_ns,
            focal_px: optics.focal_px() * (1.0 + towards(0) * failings.focal_share),
            horizon_px: optics.horizon_px() + towards(1) * failings.horizon_px,
            height_m: optics.height_m + towards(2) * failings.height_m,
            failings: *failings,
            seed,
            frames: 0,
            spurious: Vec::new(),
        }
    }

    /// The next frame: its time since the start, ns, and what moves in it; `None` when the drive is over.
    pub fn next_frame(&mut self) -> Option<(u64, CameraMotion)> {
        let stamp_ns = (self.frames + 1) * self.interval_ns;
        let time_s = stamp_ns as f64 * 1e-9;
        if time_s > self.journey.end_s() {
            return None;
        }
        self.frames += 1;
        let mut chance = of_frame(self.seed, self.frames);
        let mut silhouettes = self.silhouettes(time_s);
        silhouettes.retain(|_| chance.random::<f64>() >= self.failings.missed);
        let mut pieces: Vec<Silhouette> = merged(silhouettes).into_iter().flat_map(|entire| self.broken(entire, &mut chance)).collect();
        self.haunt(&mut chance);
        pieces.extend(self.spurious.iter().map(|(_, silhouette)| *silhouette));
        let jittered = pieces.into_iter().map(|piece| piece.jittered(self.failings.edge_px, &mut chance));
        let blobs: Vec<Blob> = jittered.filter_map(|piece| self.blob(&piece)).take(MAX_BLOBS).collect();
        Some((stamp_ns, self.message(&blobs)))
    }

    /// What the camera sees of each walker who moves.
    fn silhouettes(&mut self, time_s: f64) -> Vec<Silhouette> {
        let camera = self.journey.at(time_s).pose.then(&self.mount);
        let mut seen = Vec::new();
        for (walker, moved_s) in self.walkers.iter().zip(&mut self.moved_s) {
            let Some(legs) = walker.legs(time_s) else {
                *moved_s = time_s;
                continue;
            };
            let before_s = 0.1;
            if (walker.place(time_s) - walker.place(time_s - before_s)).norm() / before_s > STANDS_M_S {
                *moved_s = time_s;
            }
            if time_s - *moved_s > self.failings.fades_after_s {
                continue;
            }
            let in_camera = |place: Vector| {
                let (sin, cos) = camera.yaw_rad.sin_cos();
                let (dx, dy) = (place.x - camera.x_m, place.y - camera.y_m);
                Vector::new(dx * cos + dy * sin, dy * cos - dx * sin)
            };
            let body = in_camera(walker.place(time_s));
            if !DEPTHS_M.contains(&body.x) {
                continue;
            }
            let foot_m = legs.iter().map(|leg| in_camera(leg.centre).x - LEG_M).fold(f64::INFINITY, f64::min).max(0.05);
            let columns = (0..COLUMNS).map(|column| body.y + HALF_WIDTH_M * (1.0 - 2.0 * f64::from(column) / f64::from(COLUMNS - 1)));
            let visible: Vec<f64> = columns
                .filter(|aside_m| sees(&self.still, &camera, body.x, *aside_m))
                .map(|aside_m| self.size_px[0] / 2.0 - self.focal_px * aside_m / body.x)
                .collect();
            if let (Some(&left), Some(&right)) = (visible.first(), visible.last()) {
                let top = self.horizon_px - self.focal_px * (HEIGHT_M - self.height_m) / body.x;
                let bottom = self.horizon_px + self.focal_px * self.height_m / foot_m;
                seen.push(Silhouette { left, right, top, bottom });
            }
        }
        seen
    }

    /// The pieces that a silhouette falls to.
    fn broken(&self, entire: Silhouette, chance: &mut ChaCha8Rng) -> Vec<Silhouette> {
        if chance.random::<f64>() >= self.failings.fragments {
            return vec![entire];
        }
        let share = 0.3 + 0.4 * chance.random::<f64>();
        let row = entire.top.max(0.0) + share * (entire.bottom.min(self.size_px[1]) - entire.top.max(0.0));
        let column = entire.left + share * (entire.right - entire.left);
        let upper = Silhouette { bottom: row - 1.0, ..entire };
        match (chance.random::<f64>() * 3.0) as u32 {
            0 => vec![upper, Silhouette { top: row + 1.0, ..entire }],
            1 => vec![Silhouette { right: column - 1.0, ..entire }, Silhouette { left: column + 1.0, ..entire }],
            _ => vec![upper],
        }
    }

    /// False blobs come and go.
    fn haunt(&mut self, chance: &mut ChaCha8Rng) {
        self.spurious.retain(|(end, _)| *end > self.frames);
        // A blob lives half the longest life on average.
        let mean_frames = (FALSE_FRAMES as f64 + 1.0) / 2.0;
        if chance.random::<f64>() < self.failings.false_blobs / mean_frames {
            let [width, height] = self.size_px;
            let frames = 1 + (chance.random::<f64>() * FALSE_FRAMES as f64) as u64;
            let (left, top) = (chance.random::<f64>() * width, chance.random::<f64>() * height);
            let (wide, high) = (5.0 + 20.0 * chance.random::<f64>(), 8.0 + 40.0 * chance.random::<f64>());
            self.spurious.push((self.frames + frames, Silhouette { left, right: left + wide, top, bottom: top + high }));
        }
    }

    fn blob(&self, silhouette: &Silhouette) -> Option<Blob> {
        let [width, height] = self.size_px;
        let (left, right) = (silhouette.left.clamp(0.0, width).round(), silhouette.right.clamp(0.0, width).round());
        let (top, bottom) = (silhouette.top.clamp(0.0, height).round(), silhouette.bottom.clamp(0.0, height).round());
        let size = FILLED * (right - left) * (bottom - top);
        (right > left && bottom > top && size >= LEAST_PX).then_some(Blob {
            u_px: ((left + right) / 2.0) as f32,
            v_px: ((top + bottom) / 2.0) as f32,
            size_px: size as u32,
            left_px: left as u32,
            top_px: top as u32,
            right_px: right as u32,
            bottom_px: bottom as u32,
            reserved: 0,
        })
    }

    fn message(&self, blobs: &[Blob]) -> CameraMotion {
        let mut motion = CameraMotion {
            transform: [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0],
            inliers: 1.0,
            count: blobs.len() as u32,
            status: CameraStatus::Compensated as u32,
            width: self.size_px[0] as u32,
            height: self.size_px[1] as u32,
            ..CameraMotion::default()
        };
        motion.blobs.iter_mut().zip(blobs).for_each(|(slot, blob)| *slot = *blob);
        motion
    }
}

impl Silhouette {
    fn jittered(self, spread_px: f64, chance: &mut ChaCha8Rng) -> Self {
        let mut jitter = || spread_px * normal(chance);
        Self { left: self.left + jitter(), right: self.right + jitter(), top: self.top + jitter(), bottom: self.bottom + jitter() }
    }

    fn with(self, other: Self) -> Self {
        Self {
            left: self.left.min(other.left),
            right: self.right.max(other.right),
            top: self.top.min(other.top),
            bottom: self.bottom.max(other.bottom),
        }
    }
}

/// Silhouettes that overlap are one.
fn merged(silhouettes: Vec<Silhouette>) -> Vec<Silhouette> {
    let mut sorted = silhouettes;
    sorted.sort_by(|a, b| a.left.total_cmp(&b.left));
    let mut merged: Vec<Silhouette> = Vec::new();
    for silhouette in sorted {
        match merged.last_mut() {
            Some(last) if silhouette.left <= last.right => *last = last.with(silhouette),
            _ => merged.push(silhouette),
        }
    }
    merged
}

/// Whether nothing that stands hides a place, given in the camera's frame.
fn sees(still: &Still, camera: &Pose, ahead_m: f64, aside_m: f64) -> bool {
    let place = camera.then(&Pose { x_m: ahead_m, y_m: aside_m, yaw_rad: 0.0 });
    let origin = Vector::new(camera.x_m, camera.y_m);
    let towards = Vector::new(place.x_m, place.y_m) - origin;
    let distance_m = towards.norm();
    let ray = Ray { origin, direction: towards / distance_m };
    let faces = still.faces.iter().filter_map(|face| ray.meets_segment(&face.segment));
    let rounds = still.rounds.iter().filter_map(|round| ray.meets_circle(&round.circle));
    !faces.chain(rounds).any(|meeting| meeting.distance_m < distance_m)
}

#[cfg(test)]
mod tests {
    use super::*;

    const OPTICS: Optics = Optics {
        mount: Pose { x_m: 0.0, y_m: 0.0, yaw_rad: 0.0 },
        height_m: 0.3,
        field_of_view_rad: std::f64::consts::FRAC_PI_2,
        horizon_share: 0.5,
        size_px: [160, 120],
        interval_ns: 66_666_667,
    };

    /// The frames of a robot that stands for ten seconds and looks along x, past this wall, at a walker on this path.
    fn frames(wall: &str, walker: &str, failings: &Failings, seed: u64) -> Vec<CameraMotion> {
        let text = format!("wall = [{wall}]\nwalker = [{walker}]\n[robot]\nstart_m = [0, 0]\nway = [{{ to_m = [0, 0], stop_s = 9 }}]\n");
        let mut blobs = Blobs::new(&document::parse("test", &text).unwrap(), &OPTICS, failings, seed);
        std::iter::from_fn(|| blobs.next_frame()).map(|(_, motion)| motion).collect()
    }

    const CROSSES: &str = "{ from_m = [2, -5], speed_m_s = 1.0, way = [{ to_m = [2, 5] }] }";

    #[test]
    fn a_walker_is_where_geometry_puts_him() {
        let frames = frames("", CROSSES, &Failings::NONE, 1);
        // After 75 frames, 5 s, the walker is straight ahead at 2 m: f = 80 px, feet at 60 + 80 · 0.3 / 1.93 at most a step nearer.
        let blob = frames[74].blobs()[0];
        assert!((f64::from(blob.u_px) - 80.0).abs() <= 1.0, "{blob:?}");
        assert_eq!((blob.top_px, blob.right_px - blob.left_px), (4, 18));
        assert!((72..=75).contains(&blob.bottom_px), "{blob:?}");
        assert!(frames.iter().all(|frame| messages::Payload::validate(frame).is_ok()));
    }

    #[test]
    fn walls_hide_and_who_stands_fades() {
        let seen = |wall: &str, walker: &str, failings: &Failings| {
            frames(wall, walker, failings, 1).iter().filter(|frame| frame.count > 0).count()
        };
        let wall = "{ along_m = [[1, 4], [1, -4]] }";
        let all = seen("", CROSSES, &Failings::NONE);
        assert!(all > 50, "{all}");
        assert_eq!(seen(wall, CROSSES, &Failings::NONE), 0);
        let stands = "{ from_m = [2, -0.5], speed_m_s = 1.0, way = [{ to_m = [2, 0], stop_s = 8 }] }";
        let fades = Failings { fades_after_s: 0.8, ..Failings::NONE };
        assert!(seen("", stands, &Failings::NONE) > 120);
        assert!((15..=25).contains(&seen("", stands, &fades)));
    }

    #[test]
    fn false_blobs_come_as_often_as_they_should() {
        let failings = Failings { false_blobs: 0.3, ..Failings::NONE };
        let blobs: u32 = (0..20).flat_map(|seed| frames("", "", &failings, seed)).map(|frame| frame.count).sum();
        let mean = f64::from(blobs) / (20.0 * 150.0);
        assert!((0.15..=0.4).contains(&mean), "{mean} a frame, some of them too small");
    }

    #[test]
    fn silhouettes_that_overlap_are_one() {
        let at = |left: f64, right: f64| Silhouette { left, right, top: 0.0, bottom: right };
        assert_eq!(merged(vec![at(30.0, 40.0), at(10.0, 20.0), at(15.0, 25.0)]), [at(10.0, 25.0), at(30.0, 40.0)]);
    }
}
