//! A robot among smooth walls: every echo is the perpendicular to a wall, as the model of localisation has it.

#![allow(clippy::unwrap_used, clippy::panic, reason = "tests fail by panicking")]

use messages::{Pose, SonarReading, SonarScan};
use std::f64::consts::TAU;

/// Straight walls by their ends, m.
pub(crate) struct Scene(pub(crate) Vec<[[f64; 2]; 2]>);

/// How the wheels err.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Wheels {
    pub(crate) distance_share: f64,
    pub(crate) turn_share: f64,
    pub(crate) curvature_rad_m: f64,
}

/// A drive: every scan by odometry, and where the robot was.
pub(crate) struct Drive {
    pub(crate) scans: Vec<SonarScan>,
    pub(crate) truth: Vec<Pose>,
}

/// Eight sonars ahead and aside, as a Pioneer has them.
const SONARS_DEG: [f64; 8] = [90.0, 50.0, 30.0, 10.0, -10.0, -30.0, -50.0, -90.0];
const HALF_BEAM_RAD: f64 = 0.218;
const RANGE_M: f64 = 3.0;
const STEP_M: f64 = 0.03;
const TURN_RAD: f64 = 0.05;

fn wrapped(angle: f64) -> f64 {
    angle - TAU * (angle / TAU).round()
}

pub(crate) fn relative(from: &Pose, to: &Pose) -> Pose {
    let (sin, cos) = from.yaw_rad.sin_cos();
    let (dx, dy) = (to.x_m - from.x_m, to.y_m - from.y_m);
    Pose::new(cos * dx + sin * dy, cos * dy - sin * dx, to.yaw_rad - from.yaw_rad)
}

impl Scene {
    /// Closed loops of walls.
    pub(crate) fn of_loops(loops: &[&[[f64; 2]]]) -> Self {
        let of_loop =
            |corners: &&[[f64; 2]]| (0..corners.len()).map(|k| [corners[k], corners[(k + 1) % corners.len()]]).collect::<Vec<_>>();
        Self(loops.iter().flat_map(of_loop).collect())
    }

    fn range_m(&self, sonar: &Pose) -> Option<f64> {
        let ranges = self.0.iter().filter_map(|[from, to]| {
            let (dx, dy) = (to[0] - from[0], to[1] - from[1]);
            let share = ((sonar.x_m - from[0]) * dx + (sonar.y_m - from[1]) * dy) / (dx * dx + dy * dy);
            let (x, y) = (from[0] + share * dx - sonar.x_m, from[1] + share * dy - sonar.y_m);
            let is_met = (0.0..=1.0).contains(&share) && wrapped(y.atan2(x) - sonar.yaw_rad).abs() < HALF_BEAM_RAD;
            is_met.then_some(x.hypot(y))
        });
        ranges.filter(|range_m| *range_m < RANGE_M).min_by(f64::total_cmp)
    }

    /// Drives straight from place to place and turns there. The first place and the way to the second are the origin of odometry.
    pub(crate) fn drive(&self, places: &[[f64; 2]], wheels: Wheels) -> Drive {
        let truth = path(places);
        let mut odometry = Pose::default();
        let mut scans = Vec::new();
        for (k, robot) in truth.iter().enumerate() {
            if let Some(before) = k.checked_sub(1) {
                let step = relative(&truth[before], robot);
                let path_m = step.x_m.hypot(step.y_m);
                let share = 1.0 + wheels.distance_share;
                let yaw_rad = wrapped(step.yaw_rad) * (1.0 + wheels.turn_share) + wheels.curvature_rad_m * path_m;
                odometry = odometry.then(&Pose::new(step.x_m * share, step.y_m * share, yaw_rad));
            }
            // Two sonars fire between two packets, one on each side.
            let readings: Vec<SonarReading> = [k % 4, 4 + k % 4].iter().map(|&number| self.reading(number, robot)).collect();
            scans.push(SonarScan::new(odometry, &readings, false));
        }
        let start = truth[0];
        Drive { scans, truth: truth.iter().map(|pose| relative(&start, pose)).collect() }
    }

    fn reading(&self, number: usize, robot: &Pose) -> SonarReading {
        let yaw_rad = SONARS_DEG[number].to_radians();
        let mount = Pose::new(0.12 * yaw_rad.cos(), 0.12 * yaw_rad.sin(), yaw_rad);
        let range_m = self.range_m(&robot.then(&mount));
        SonarReading::new(number as u32, mount, range_m.unwrap_or(RANGE_M), range_m.is_some())
    }
}

fn path(places: &[[f64; 2]]) -> Vec<Pose> {
    let mut poses: Vec<Pose> = Vec::new();
    for pair in places.windows(2) {
        let (dx, dy) = (pair[1][0] - pair[0][0], pair[1][1] - pair[0][1]);
        let heading = dy.atan2(dx);
        let before = poses.last().map_or(heading, |pose| pose.yaw_rad);
        let turn = wrapped(heading - before);
        let turns = (turn.abs() / TURN_RAD).ceil();
        poses.extend((1..=turns as u32).map(|k| Pose::new(pair[0][0], pair[0][1], before + turn * f64::from(k) / turns)));
        let yaw_rad = before + turn;
        let steps = (dx.hypot(dy) / STEP_M).ceil();
        poses.extend(
            (0..=steps as u32)
                .map(|k| f64::from(k) / steps)
                .map(|share| Pose::new(pair[0][0] + share * dx, pair[0][1] + share * dy, yaw_rad)),
        );
    }
    poses
}

/// A loop of corridors, 2 m wide, around a block of 10 m by 6 m with recesses, so that no two stretches are alike.
pub(crate) fn block() -> Scene {
    Scene::of_loops(&[
        &[
            [0.0, 0.0],
            [4.0, 0.0],
            [4.0, -0.3],
            [5.2, -0.3],
            [5.2, 0.0],
            [14.0, 0.0],
            [14.0, 3.0],
            [14.4, 3.0],
            [14.4, 4.5],
            [14.0, 4.5],
            [14.0, 10.0],
            [9.0, 10.0],
            [9.0, 10.3],
            [7.5, 10.3],
            [7.5, 10.0],
            [0.0, 10.0],
        ],
        &[[2.0, 2.0], [2.0, 8.0], [12.0, 8.0], [12.0, 2.0], [8.0, 2.0], [8.0, 2.3], [6.5, 2.3], [6.5, 2.0]],
    ])
}

/// The way around the block and `on` metres of it once more.
pub(crate) fn around_block(on_m: f64) -> Vec<[f64; 2]> {
    vec![[2.0, 1.0], [13.0, 1.0], [13.0, 9.0], [1.0, 9.0], [1.0, 1.0], [1.0 + on_m, 1.0]]
}

/// Largest distance between two lists of poses, m, and between their headings, rad, with the first laid rigidly on the second.
pub(crate) fn apart(poses: &[Pose], truth: &[Pose]) -> (f64, f64) {
    assert_eq!(poses.len(), truth.len());
    let mean = |list: &[Pose]| {
        [list.iter().map(|it| it.x_m).sum::<f64>() / list.len() as f64, list.iter().map(|it| it.y_m).sum::<f64>() / list.len() as f64]
    };
    let (from, to) = (mean(poses), mean(truth));
    let products = poses.iter().zip(truth).map(|(pose, target)| {
        let (p, t) = ([pose.x_m - from[0], pose.y_m - from[1]], [target.x_m - to[0], target.y_m - to[1]]);
        [p[0] * t[0] + p[1] * t[1], p[0] * t[1] - p[1] * t[0]]
    });
    let [cos, sin] = products.fold([0.0, 0.0], |sum, product| [sum[0] + product[0], sum[1] + product[1]]);
    let motion = Pose::new(to[0], to[1], sin.atan2(cos)).then(&Pose::new(-from[0], -from[1], 0.0));
    let largest = |error: &dyn Fn(&Pose, &Pose) -> f64| {
        poses.iter().zip(truth).map(|(one, other)| error(&motion.then(one), other)).fold(0.0, f64::max)
    };
    let distance = largest(&|one, other| (one.x_m - other.x_m).hypot(one.y_m - other.y_m));
    (distance, largest(&|one, other| wrapped(one.yaw_rad - other.yaw_rad).abs()))
}
