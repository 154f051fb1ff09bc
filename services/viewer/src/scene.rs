//! The robot, its sonars and the walkers, as of the newest scan.

use core::any::Any;
use std::collections::{BTreeMap, VecDeque};
use std::f64::consts::PI;

use geometry::MapFromOdom;
use messages::{
    CameraMotion, CameraStatus, FilterVerdict, Heartbeat, PlaybackControl, Pose, RobotEstimate, SonarMotion, SonarScan, TrackedWalker,
    TruthScan, TruthSurfaces, Walkers, seconds,
};
use serde::Serialize;

/// Most scans that wait for their verdict: more than fall into a commit horizon at the rate of any robot.
const MOST_WAITING: usize = 256;
/// Time for which a walker and a sonar cone are shown after their last message, s of sensor time.
const WALKER_SHOWN_S: f64 = 1.0;
/// Most sonar movers that are shown.
const MOST_SONAR_MOVERS: usize = 32;
/// Radius of a walker, m: half the shoulder breadth of a person.
const WALKER_RADIUS_M: f64 = 0.25;
/// Time for which a withheld echo is shown, s of sensor time.
const WITHHELD_SHOWN_S: f64 = 4.0;
/// Most withheld echoes that are shown.
const MOST_WITHHELD: usize = 64;
/// Time for which an update region or a sonar mover is shown, s of sensor time.
const REGION_SHOWN_S: f64 = 0.6;
/// Most update regions that are shown.
const MOST_REGIONS: usize = 32;

/// The robot, its sonars and the walkers according to the newest messages. Messages and what is kept of them are in the odom frame; they
/// are drawn in the map frame, by the newest estimate.
#[derive(Debug, Clone, Default)]
pub struct Scene {
    cell_m: f64,
    /// Name of the playback process.
    playback: Option<String>,
    replay: Option<Replay>,
    first_ns: Option<u64>,
    stamp_ns: u64,
    scans: u64,
    /// The newest estimate of the odom frame; `None` without localisation.
    map_from_odom: Option<MapFromOdom>,
    pose: Pose,
    /// The newest reading of each sonar.
    cones: BTreeMap<u32, Timed<SonarCone>>,
    /// Scans without a verdict.
    waiting: VecDeque<(u64, Timed<SonarScan>)>,
    walkers: BTreeMap<u64, Timed<TrackedWalker>>,
    sonar_movers: VecDeque<Timed<Region>>,
    camera: Option<CameraView>,
    regions: VecDeque<Timed<Region>>,
    withheld: VecDeque<Timed<[f64; 2]>>,
    /// Inputs of the last verdict, as flags.
    inputs: Option<u32>,
    /// Pose of the map frame in the world frame.
    start: Option<Pose>,
    true_walkers: Vec<[f64; 2]>,
}

/// A value with the sensor time of its message.
#[derive(Debug, Clone, Copy)]
struct Timed<T> {
    stamp_ns: u64,
    value: T,
}

/// The newest reading of a sonar in the map frame.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct SonarCone {
    /// Position of the transducer, m.
    pub x: f64,
    /// Position of the transducer, m.
    pub y: f64,
    /// Direction of the axis, rad.
    pub yaw: f64,
    /// Range of the echo, or of the sensor without an echo, m.
    pub range: f64,
    /// Whether there was an echo.
    pub echo: bool,
}

/// A disc in the map frame.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Region {
    /// Centre, m.
    pub x: f64,
    /// Centre, m.
    pub y: f64,
    /// Radius, m.
    pub radius: f64,
}

/// A tracked walker in the map frame.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct WalkerView {
    /// Name of the track: letters, constant for the life of the track.
    pub name: String,
    /// Position and radius.
    #[serde(flatten)]
    pub region: Region,
    /// Velocity along x, m/s.
    pub vx: f64,
    /// Velocity along y, m/s.
    pub vy: f64,
}

/// What moves in the picture of the camera.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct CameraView {
    /// Result of the last picture, as a text.
    pub state: &'static str,
    /// Height of the picture divided by its width.
    pub aspect: f64,
    /// Left, top, right and bottom of each blob as shares of the picture, 0 to 1.
    pub blobs: Vec<[f64; 4]>,
}

/// The state of a replay, from the heartbeats of playback.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Replay {
    /// Whether it is paused.
    pub paused: bool,
    /// Speed relative to the drive; `None` in lockstep, which has no speed.
    pub times: Option<f64>,
    /// Share of the log that is played, 0 to 1.
    pub done: f64,
}

/// What the page draws over the map.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(tag = "kind", rename = "scene")]
pub struct SceneView {
    /// Sensor time since the first scan, s.
    pub t: f64,
    /// Sequence number of the newest scan.
    pub scans: u64,
    /// x, y (m) and yaw (rad) of the robot in the map frame; `None` before the first scan.
    pub robot: Option<[f64; 3]>,
    /// The newest reading of each sonar.
    pub cones: Vec<SonarCone>,
    /// The walkers that the filter tracks.
    pub walkers: Vec<WalkerView>,
    /// Positions where the sonars detect motion.
    pub sonar_movers: Vec<Region>,
    /// Update regions of the filter.
    pub regions: Vec<Region>,
    /// Positions of the echoes that were withheld from the map lately, m.
    pub withheld: Vec<[f64; 2]>,
    /// Whether verdicts use motion from the sonars; `None` without verdicts.
    pub from_sonar: Option<bool>,
    /// Whether verdicts use motion from the camera; `None` without verdicts.
    pub from_camera: Option<bool>,
    /// True positions of the walkers in a simulation, m.
    pub true_walkers: Vec<[f64; 2]>,
    /// What moves in the picture of the camera, if there is one.
    pub camera: Option<CameraView>,
    /// The replay, if there is one.
    pub replay: Option<Replay>,
}

impl Scene {
    /// A scene over a map with cells of edge `cell_m`. `playback` is the name of the playback process, if there is one.
    #[must_use]
    pub fn new(cell_m: f64, playback: Option<&str>) -> Self {
        Self { cell_m, playback: playback.map(str::to_owned), ..Self::default() }
    }

    /// Takes a message of any service; true if it may change what is drawn. Payloads that are not drawn change nothing.
    pub fn message(&mut self, seq: u64, stamp_ns: u64, payload: &dyn Any) -> bool {
        if let Some(scan) = payload.downcast_ref() {
            self.scan(seq, stamp_ns, scan);
        } else if let Some(motion) = payload.downcast_ref() {
            self.motion(stamp_ns, motion);
        } else if let Some(motion) = payload.downcast_ref() {
            self.camera(motion);
        } else if let Some(verdict) = payload.downcast_ref() {
            self.verdict(seq, verdict);
        } else if let Some(walkers) = payload.downcast_ref() {
            self.walkers(stamp_ns, walkers);
        } else if let Some(estimate) = payload.downcast_ref() {
            self.estimate(estimate);
        } else if let Some(truth) = payload.downcast_ref() {
            self.truth(truth);
        } else if let Some(surfaces) = payload.downcast_ref() {
            self.surfaces(surfaces);
        } else if let Some(heartbeat) = payload.downcast_ref() {
            return self.heartbeat(heartbeat);
        } else {
            return false;
        }
        true
    }

    /// Takes a heartbeat; true if it changes the state of the replay.
    fn heartbeat(&mut self, heartbeat: &Heartbeat) -> bool {
        if self.playback.as_deref() != Some(heartbeat.process.as_str()) {
            return false;
        }
        let counters = heartbeat.counters.iter().take(heartbeat.counters_count as usize);
        let value = |name: &str| counters.clone().find(|counter| counter.name.as_str() == name).map(|counter| counter.value);
        let share = |(done, total): (u64, u64)| if total > 0 { done as f64 / total as f64 } else { 0.0 };
        let replay = Replay {
            paused: value(PlaybackControl::PAUSED) == Some(1),
            times: value(PlaybackControl::PERCENT).map(|percent| percent as f64 * 0.01),
            done: value("done").zip(value("total")).map_or(0.0, share),
        };
        self.replay.replace(replay) != Some(replay)
    }

    /// Takes a scan.
    fn scan(&mut self, seq: u64, stamp_ns: u64, scan: &SonarScan) {
        self.first_ns.get_or_insert(stamp_ns);
        self.stamp_ns = stamp_ns;
        self.scans = seq;
        self.pose = scan.pose;
        for reading in scan.readings() {
            let Pose { x_m: x, y_m: y, yaw_rad: yaw } = scan.pose.then(&reading.mount);
            let value = SonarCone { x, y, yaw, range: reading.range_m, echo: reading.echo == 1 };
            self.cones.insert(reading.sonar, Timed { stamp_ns, value });
        }
        self.waiting.push_back((seq, Timed { stamp_ns, value: *scan }));
        if self.waiting.len() > MOST_WAITING {
            self.waiting.pop_front();
        }
        self.expire();
    }

    /// Takes the verdict on a scan.
    fn verdict(&mut self, seq: u64, verdict: &FilterVerdict) {
        self.inputs = Some(verdict.inputs);
        while self.waiting.front().is_some_and(|(waiting, _)| *waiting < seq) {
            self.waiting.pop_front();
        }
        for region in verdict.regions.iter().take(verdict.count as usize) {
            let value = Region { x: region.x_m, y: region.y_m, radius: self.radius(region.cells) };
            push_bounded(&mut self.regions, MOST_REGIONS, Timed { stamp_ns: self.stamp_ns, value });
        }
        let Some((_, Timed { value: scan, .. })) = self.waiting.pop_front_if(|(waiting, _)| *waiting == seq) else { return };
        for (index, reading) in scan.readings().iter().enumerate() {
            if verdict.withholds(index) && reading.echo == 1 {
                let at = scan.pose.then(&reading.mount).then(&Pose { x_m: reading.range_m, ..Pose::default() });
                push_bounded(&mut self.withheld, MOST_WITHHELD, Timed { stamp_ns: self.stamp_ns, value: [at.x_m, at.y_m] });
            }
        }
    }

    /// Takes motion that the sonars detect.
    fn motion(&mut self, stamp_ns: u64, motion: &SonarMotion) {
        for mover in motion.movers() {
            let value = Region { x: mover.map_x_m, y: mover.map_y_m, radius: self.radius(f64::from(mover.cells)) };
            push_bounded(&mut self.sonar_movers, MOST_SONAR_MOVERS, Timed { stamp_ns, value });
        }
    }

    /// Takes the walkers that the filter tracks.
    fn walkers(&mut self, stamp_ns: u64, walkers: &Walkers) {
        for walker in walkers.walkers() {
            self.walkers.insert(walker.track, Timed { stamp_ns, value: *walker });
        }
    }

    /// Takes motion that the camera detects.
    fn camera(&mut self, motion: &CameraMotion) {
        let share = |px: u32, of: u32| f64::from(px) / f64::from(of.max(1));
        let (width, height) = (motion.width, motion.height);
        self.camera = Some(CameraView {
            state: match CameraStatus::from_number(motion.status) {
                Some(CameraStatus::Compensated) => "moving blobs are framed",
                Some(CameraStatus::Learning) => "learning the background",
                Some(CameraStatus::NotCompensated) => "the camera motion could not be compensated",
                Some(CameraStatus::Refused) | None => "a picture was refused",
            },
            aspect: share(height, width),
            blobs: motion
                .blobs()
                .iter()
                .map(|blob| {
                    [share(blob.left_px, width), share(blob.top_px, height), share(blob.right_px, width), share(blob.bottom_px, height)]
                })
                .collect(),
        });
    }

    /// Takes an estimate of the robot.
    fn estimate(&mut self, estimate: &RobotEstimate) {
        self.map_from_odom = Some(MapFromOdom::from_wire(&estimate.map_from_odom));
    }

    /// Takes the true positions of the walkers.
    fn truth(&mut self, truth: &TruthScan) {
        let Some(start) = self.start else { return };
        let (sin, cos) = start.yaw_rad.sin_cos();
        let walkers = truth.walkers_m.iter().take(truth.walkers_count as usize);
        self.true_walkers = walkers
            .map(|[x, y]| {
                let (dx, dy) = (x - start.x_m, y - start.y_m);
                [cos * dx + sin * dy, cos * dy - sin * dx]
            })
            .collect();
    }

    /// Takes the start of the drive in the world frame.
    fn surfaces(&mut self, surfaces: &TruthSurfaces) {
        self.start = Some(surfaces.start);
    }

    /// The scene as the page draws it.
    #[must_use]
    pub fn view(&self) -> SceneView {
        let frame = self.map_from_odom.unwrap_or(MapFromOdom::IDENTITY);
        let in_map = |region: &Region| {
            let [x, y] = frame.apply([region.x, region.y]);
            Region { x, y, radius: region.radius }
        };
        SceneView {
            t: self.first_ns.map_or(0.0, |first_ns| seconds(self.stamp_ns.saturating_sub(first_ns))),
            scans: self.scans,
            robot: self.first_ns.map(|_| {
                let Pose { x_m, y_m, yaw_rad } = frame.to_wire().then(&self.pose);
                [x_m, y_m, yaw_rad]
            }),
            cones: self.cones.values().map(|cone| cone.value.seen_from(&frame)).collect(),
            walkers: self.walkers.values().map(|walker| walker_view(&walker.value, &frame)).collect(),
            sonar_movers: self.sonar_movers.iter().map(|mover| in_map(&mover.value)).collect(),
            regions: self.regions.iter().map(|region| in_map(&region.value)).collect(),
            withheld: self.withheld.iter().map(|echo| frame.apply(echo.value)).collect(),
            from_sonar: self.inputs.map(|inputs| inputs & FilterVerdict::FROM_SONAR != 0),
            from_camera: self.inputs.map(|inputs| inputs & FilterVerdict::FROM_CAMERA != 0),
            true_walkers: self.true_walkers.clone(),
            camera: self.camera.clone(),
            replay: self.replay,
        }
    }

    /// Drops what is too old. A jump of the stamps, as between two drives, drops everything.
    fn expire(&mut self) {
        let now = self.stamp_ns;
        let fresh = |stamp_ns: u64, shown_s: f64| seconds(now.saturating_sub(stamp_ns)) <= shown_s;
        self.walkers.retain(|_, walker| fresh(walker.stamp_ns, WALKER_SHOWN_S));
        self.sonar_movers.retain(|mover| fresh(mover.stamp_ns, REGION_SHOWN_S));
        self.regions.retain(|region| fresh(region.stamp_ns, REGION_SHOWN_S));
        self.withheld.retain(|echo| fresh(echo.stamp_ns, WITHHELD_SHOWN_S));
        self.cones.retain(|_, cone| fresh(cone.stamp_ns, WALKER_SHOWN_S));
    }

    /// Radius of a disc of so many cells, m.
    fn radius(&self, cells: f64) -> f64 {
        (cells.max(0.0) / PI).sqrt() * self.cell_m
    }
}

impl SonarCone {
    fn seen_from(&self, map_from_odom: &MapFromOdom) -> Self {
        let [x, y] = map_from_odom.apply([self.x, self.y]);
        Self { x, y, yaw: map_from_odom.yaw_rad + self.yaw, ..*self }
    }
}

fn walker_view(walker: &TrackedWalker, map_from_odom: &MapFromOdom) -> WalkerView {
    let [x, y] = map_from_odom.apply([walker.x_m, walker.y_m]);
    let [vx, vy] = MapFromOdom::new(0.0, 0.0, map_from_odom.yaw_rad).apply([walker.velocity_x_m_s, walker.velocity_y_m_s]);
    WalkerView { name: name(walker.track), region: Region { x, y, radius: WALKER_RADIUS_M }, vx, vy }
}

/// Appends a value; the oldest goes when there are more than `most`.
fn push_bounded<T>(queue: &mut VecDeque<T>, most: usize, value: T) {
    queue.push_back(value);
    if queue.len() > most {
        queue.pop_front();
    }
}

/// The name of a track: 1 is A, 26 is Z, 27 is AA. 0 has no name.
fn name(mut track: u64) -> String {
    let mut letters = Vec::new();
    while track > 0 {
        track -= 1;
        letters.push(char::from(b'A' + (track % 26) as u8));
        track /= 26;
    }
    letters.iter().rev().collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use messages::{Blob, Counter, Mover, SonarReading, Text, UpdateRegion};

    fn scan(x_m: f64) -> SonarScan {
        let mount = Pose { x_m: 0.1, y_m: 0.0, yaw_rad: PI / 2.0 };
        let reading = SonarReading { mount, range_m: 2.0, sonar: 3, echo: 1 };
        SonarScan::new(Pose { x_m, y_m: 0.0, yaw_rad: 0.0 }, &[reading], false)
    }

    #[test]
    fn a_withheld_echo_is_shown_at_its_position() {
        let mut scene = Scene::new(0.05, None);
        scene.scan(1, 0, &scan(1.0));
        scene.scan(2, 100_000_000, &scan(5.0));
        let mut verdict = FilterVerdict { withheld: 1, count: 1, inputs: FilterVerdict::FROM_SONAR, ..FilterVerdict::default() };
        verdict.regions[0] = UpdateRegion { x_m: 1.1, y_m: 2.0, cells: PI * 16.0 };
        scene.verdict(1, &verdict);
        let view = scene.view();
        assert!((view.withheld[0][0] - 1.1).abs() < 1e-9 && (view.withheld[0][1] - 2.0).abs() < 1e-9, "{:?}", view.withheld);
        assert_eq!(view.regions, [Region { x: 1.1, y: 2.0, radius: 4.0 * 0.05 }]);
        assert_eq!((view.from_sonar, view.from_camera), (Some(true), Some(false)));
        scene.verdict(2, &FilterVerdict::default());
        assert_eq!(scene.view().withheld.len(), 1, "an echo that is not withheld is not shown");
        scene.scan(3, 9_000_000_000, &scan(6.0));
        let view = scene.view();
        assert!(view.withheld.is_empty() && view.regions.is_empty());
        assert_eq!((view.t, view.scans, view.robot), (9.0, 3, Some([6.0, 0.0, 0.0])));
    }

    #[test]
    fn everything_is_drawn_in_the_map_frame() {
        let mut scene = Scene::new(0.05, None);
        scene.scan(1, 0, &scan(1.0));
        let mut walkers = Walkers { count: 1, ..Walkers::default() };
        walkers.walkers[0] = TrackedWalker { x_m: 3.0, velocity_y_m_s: 1.2, track: 2, ..TrackedWalker::default() };
        scene.walkers(0, &walkers);
        let mut motion = SonarMotion { count: 1, ..SonarMotion::default() };
        motion.movers[0] = Mover { map_x_m: 2.0, cells: 50, ..Mover::default() };
        scene.motion(0, &motion);
        let mut verdict = FilterVerdict { withheld: 1, count: 1, ..FilterVerdict::default() };
        verdict.regions[0] = UpdateRegion { x_m: 1.1, y_m: 2.0, cells: 16.0 };
        scene.verdict(1, &verdict);
        scene.estimate(&RobotEstimate { map_from_odom: Pose::new(10.0, 0.0, PI / 2.0), ..RobotEstimate::default() });
        let view = scene.view();
        let places = [
            ([view.robot.unwrap()[0], view.robot.unwrap()[1]], [10.0, 1.0]),
            ([view.cones[0].x, view.cones[0].y], [10.0, 1.1]),
            ([view.walkers[0].region.x, view.walkers[0].region.y], [10.0, 3.0]),
            ([view.walkers[0].vx, view.walkers[0].vy], [-1.2, 0.0]),
            ([view.sonar_movers[0].x, view.sonar_movers[0].y], [10.0, 2.0]),
            ([view.regions[0].x, view.regions[0].y], [8.0, 1.1]),
            (view.withheld[0], [8.0, 1.1]),
        ];
        for (at, ([x, y], [expected_x, expected_y])) in places.into_iter().enumerate() {
            assert!((x - expected_x).hypot(y - expected_y) < 1e-9, "{at}: {x} {y}");
        }
    }

    #[test]
    fn walkers_and_sonar_movers_are_shown_until_they_expire() {
        let mut scene = Scene::new(0.05, None);
        let mut walkers = Walkers { count: 1, ..Walkers::default() };
        walkers.walkers[0] = TrackedWalker { x_m: 3.0, velocity_y_m_s: 1.2, track: 2, ..TrackedWalker::default() };
        scene.walkers(0, &walkers);
        let mut motion = SonarMotion { count: 1, ..SonarMotion::default() };
        motion.movers[0] = Mover { map_x_m: 2.0, cells: 50, ..Mover::default() };
        scene.motion(0, &motion);
        let view = scene.view();
        assert_eq!((view.walkers.len(), view.walkers[0].name.as_str(), view.walkers[0].region.x), (1, "B", 3.0));
        assert_eq!((view.sonar_movers.len(), view.sonar_movers[0].x), (1, 2.0));
        scene.scan(9, 2_000_000_000, &scan(0.0));
        assert!(scene.view().walkers.is_empty() && scene.view().sonar_movers.is_empty());
        for (track, expected) in [(0, ""), (1, "A"), (26, "Z"), (27, "AA"), (52, "AZ"), (53, "BA")] {
            assert_eq!(name(track), expected);
        }
        assert_eq!(name(u64::MAX).len(), 14);
    }

    #[test]
    fn the_replay_state_comes_from_the_playback_heartbeat() {
        let mut scene = Scene::new(0.05, Some("playback"));
        let mut beat = Heartbeat { process: Text::new("mapping"), ..Heartbeat::default() };
        assert!(!scene.heartbeat(&beat) && scene.view().replay.is_none());
        beat.process = Text::new("playback");
        let counters = [("done", 25), ("total", 100), (PlaybackControl::PAUSED, 1), (PlaybackControl::PERCENT, 250)];
        for (counter, (name, value)) in beat.counters.iter_mut().zip(counters) {
            *counter = Counter { name: Text::new(name), value };
        }
        beat.counters_count = 4;
        assert!(scene.heartbeat(&beat) && !scene.heartbeat(&beat));
        assert_eq!(scene.view().replay, Some(Replay { paused: true, times: Some(2.5), done: 0.25 }));
    }

    #[test]
    fn blobs_are_shares_of_the_picture() {
        let mut scene = Scene::new(0.05, None);
        let mut motion =
            CameraMotion { count: 1, width: 160, height: 120, status: CameraStatus::Learning as u32, ..CameraMotion::default() };
        motion.blobs[0] = Blob { left_px: 40, top_px: 30, right_px: 80, bottom_px: 120, ..Blob::default() };
        scene.camera(&motion);
        let camera = scene.view().camera.unwrap();
        assert_eq!((camera.blobs[0], camera.aspect), ([0.25, 0.25, 0.5, 1.0], 0.75));
        assert!(camera.state.starts_with("learning"));
    }

    #[test]
    fn true_walkers_are_shown_in_the_map_frame() {
        let mut scene = Scene::new(0.05, None);
        let mut truth = TruthScan { walkers_count: 1, ..TruthScan::default() };
        truth.walkers_m[0] = [1.0, 5.0];
        scene.truth(&truth);
        assert!(scene.view().true_walkers.is_empty(), "without the start there is no map frame");
        scene.surfaces(&TruthSurfaces { start: Pose { x_m: 1.0, y_m: 2.0, yaw_rad: PI / 2.0 }, ..TruthSurfaces::default() });
        scene.truth(&truth);
        let [[x, y]] = scene.view().true_walkers[..] else { panic!("one walker") };
        assert!((x - 3.0).abs() < 1e-9 && y.abs() < 1e-9, "{x} {y}");
    }
}
