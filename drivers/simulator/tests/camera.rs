//! The camera: its geometry, its truth, its sameness, and what background subtraction makes of its pictures.
#![expect(clippy::unwrap_used, reason = "tests fail by panicking")]

use messages::{FrameLayout, PixelFormat, Pose};
use proptest::prelude::*;
use sbs::plane::Plane;
use sbs::score::Score;
use sbs::{Frame, Parameters, State};
use stillmap_simulator::camera::{Camera, Flaws, LABEL_BACKGROUND, LABEL_SHADOW, LABEL_WALKER, Moment, Picture};
use stillmap_simulator::{Optics, World};

const ROBOT: &str = "[robot]\nstart_m = [0, 0]\nway = [{ to_m = [0, 0], stop_s = 20 }]\n";

/// A corridor along x with doors on both sides and something in it.
const CORRIDOR: &str = "
    box = [{ centre_m = [9.0, 1.0], size_m = [0.9, 0.3], height_m = 0.5 }]
    pillar = [{ centre_m = [12.0, -0.9], radius_m = 0.15, height_m = 0.6 }]
    wall = [
        { along_m = [[-2, -1.15], [16, -1.15]], door = [{ at_m = 5, width_m = 1, recess_m = 0.2 }, { at_m = 10, width_m = 1, recess_m = 0.2 }] },
        { along_m = [[16, -1.15], [16, 1.15]] },
        { along_m = [[16, 1.15], [-2, 1.15]], door = [{ at_m = 8, width_m = 1, recess_m = 0.2 }], gap = [{ at_m = 12, width_m = 1.1, jamb_m = 0.15 }] },
    ]
    ";

/// A walker who goes away from the robot, one who comes, and one who crosses.
const WALKERS: &str = "walker = [
    { from_m = [2.2, -0.9], start_s = 1, speed_m_s = 0.6, step_m = 0.55, way = [{ to_m = [3.0, 0.3] }, { to_m = [9, 0.4] }] },
    { from_m = [12, 0.2], start_s = 0, speed_m_s = 1.0, way = [{ to_m = [3.5, -0.5] }, { to_m = [3.2, 0.9] }, { to_m = [14, 0.0] }] },
    { from_m = [6, -1.1], start_s = 3, speed_m_s = 0.8, way = [{ to_m = [6.5, 0.9] }, { to_m = [4.5, -0.8] }, { to_m = [12, 0.5] }] },
]\n";

fn world(text: &str) -> World {
    world_file::parse("test", &format!("{text}{ROBOT}")).unwrap()
}

fn optics(size_px: [u32; 2]) -> Optics {
    Optics {
        mount: Pose::default(),
        height_m: 0.3,
        field_of_view_rad: 70_f64.to_radians(),
        horizon_share: 0.5,
        size_px,
        interval_ns: 66_666_667,
    }
}

fn at(time_s: f64, robot: Pose) -> Moment {
    Moment { time_s, robot, covered_m: 0.0 }
}

/// The first and the last row with a walker in it; the last one is that of the feet.
fn rows_of_walkers(picture: &Picture, width: usize) -> Option<(usize, usize)> {
    let with = |labels: &[u8]| labels.contains(&LABEL_WALKER);
    let mut rows = picture.labels.chunks(width).enumerate().filter(|(_, labels)| with(labels)).map(|(row, _)| row);
    let first = rows.next()?;
    Some((first, rows.next_back().unwrap_or(first)))
}

#[test]
fn a_walker_straight_ahead_stands_on_the_row_of_the_ground_cue() {
    for (ahead_m, size_px) in [(1.2, [160, 120]), (2.0, [160, 120]), (3.0, [320, 240]), (5.0, [640, 480])] {
        // Feet together: the toes are 0.14 m before the middle of the body, as one who looks at the camera has them.
        let walker =
            format!("walker = [{{ from_m = [{ahead_m}, 0], way = [{{ to_m = [{ahead_m}, 0], stop_s = 9 }}, {{ to_m = [0.5, 0] }}] }}]\n");
        let (optics, mut picture) = (optics(size_px), Picture::default());
        Camera::new(&world(&walker), &optics, &Flaws::NONE, 1).take_from(1, &at(4.0, Pose::default()), &mut picture);
        let (top, foot) = rows_of_walkers(&picture, size_px[0] as usize).unwrap();
        let expected = optics.horizon_px() + optics.focal_px() * optics.height_m / ahead_m;
        let nearest = optics.horizon_px() + optics.focal_px() * optics.height_m / (ahead_m - 0.15);
        assert!(foot as f64 + 1.0 >= expected - 1.0 && foot as f64 <= nearest + 1.0, "{foot}, expected {expected} to {nearest}");
        let head = (optics.horizon_px() - optics.focal_px() * (1.70 - optics.height_m) / ahead_m).max(0.0);
        assert!((top as f64 - head).abs() <= 1.5 * optics.focal_px() / 100.0, "{top}, expected {head}");
    }
}

#[test]
fn a_walker_to_the_left_is_on_the_left_and_a_wall_hides_him() {
    let walker = "walker = [{ from_m = [3, 1], way = [{ to_m = [3, 1], stop_s = 9 }] }]\n";
    let wall = "wall = [{ along_m = [[2, -3], [2, 3]] }]\n";
    let low = "box = [{ centre_m = [2, 0.6], size_m = [0.2, 2.0], height_m = 0.5 }]\n";
    let mut picture = Picture::default();
    let mut columns = |text: &str| -> Vec<usize> {
        Camera::new(&world(text), &optics([160, 120]), &Flaws::NONE, 1).take_from(1, &at(4.0, Pose::default()), &mut picture);
        (0..picture.labels.len()).filter(|place| picture.labels[*place] == LABEL_WALKER).collect()
    };
    let seen = columns(walker);
    let middle = seen.iter().map(|place| place % 160).sum::<usize>() as f64 / seen.len() as f64;
    let expected = 80.0 - optics([160, 120]).focal_px() / 3.0;
    assert!((middle - expected).abs() < 1.0, "{middle}, expected {expected}");
    assert_eq!(columns(&format!("{wall}{walker}")), [] as [usize; 0]);
    // A box of half a metre hides what is below its upper edge, and nothing else.
    let over = columns(&format!("{low}{walker}"));
    let edge = (60.0 - optics([160, 120]).focal_px() * 0.2 / 1.9) as usize;
    assert!(over.iter().all(|place| place / 160 <= edge), "edge {edge}");
    assert_eq!(over.iter().filter(|place| **place / 160 < edge - 1).count(), seen.iter().filter(|place| **place / 160 < edge - 1).count());
}

#[test]
fn feet_have_a_shadow_under_them() {
    let walker = "walker = [{ from_m = [2, 0], way = [{ to_m = [2, 0], stop_s = 9 }] }]\n";
    let (mut with, mut without) = (Picture::default(), Picture::default());
    let take = |text: &str, picture: &mut Picture| {
        Camera::new(&world(text), &optics([160, 120]), &Flaws::NONE, 1).take_from(1, &at(4.0, Pose::default()), picture);
    };
    take(walker, &mut with);
    take("", &mut without);
    let shadow: Vec<usize> = (0..with.labels.len()).filter(|place| with.labels[*place] == LABEL_SHADOW).collect();
    assert!(shadow.len() > 50, "{}", shadow.len());
    assert!(shadow.iter().all(|place| with.grey[*place] < without.grey[*place]));
    // On the floor, and about as near as the feet.
    assert!(shadow.iter().all(|place| (72..86).contains(&(place / 160))));
    let unlike = (0..with.grey.len())
        .filter(|place| with.labels[*place] == LABEL_BACKGROUND && with.grey[*place].abs_diff(without.grey[*place]) > 20);
    assert_eq!(unlike.count(), 0);
}

#[test]
fn the_same_seed_gives_the_same_bytes_in_any_order() {
    let world = world(&format!("{CORRIDOR}{WALKERS}"));
    let camera = |seed| Camera::new(&world, &optics([160, 120]), &Flaws::default(), seed);
    let (mut first, mut second, mut third) = (Picture::default(), Picture::default(), Picture::default());
    let mut one = camera(5);
    (1..=40).for_each(|frame| one.take(frame, &mut first));
    camera(5).take(40, &mut second);
    assert!(first == second);
    one.take(41, &mut second);
    assert!(first.grey != second.grey);
    camera(6).take(40, &mut third);
    assert!(first.grey != third.grey);
    // Golden: a change of the picture is a change of every recorded drive.
    let sum = first.grey.iter().fold(0_u32, |sum, grey| sum.wrapping_mul(31).wrapping_add(u32::from(*grey)));
    assert_eq!((first.grey.len(), sum), (160 * 120, GOLDEN), "{sum:#x}");
}

/// Sum of the bytes of frame 40 of the corridor with seed 5.
const GOLDEN: u32 = 0x2B44_AED4;

#[test]
fn driving_shakes_the_camera_and_standing_does_not() {
    let world = world(CORRIDOR);
    let mut camera = Camera::new(&world, &optics([160, 120]), &Flaws { noise: 0.0, drift: 0.0, ..Flaws::default() }, 1);
    let mut take = |frame: u64, covered_m: f64| {
        let mut picture = Picture::default();
        camera.take_from(frame, &Moment { covered_m, ..at(frame as f64, Pose::default()) }, &mut picture);
        picture
    };
    assert!(take(1, 1.0) == take(2, 1.0));
    assert!(take(1, 1.0) != take(1, 1.05));
}

/// Score of background subtraction on 120 frames of a robot that moves like this.
fn score(seed: u64, pose: impl Fn(f64) -> (Pose, f64)) -> Score {
    let mut camera = Camera::new(&world(&format!("{CORRIDOR}{WALKERS}")), &optics([160, 120]), &Flaws::default(), seed);
    let layout = FrameLayout { width: 160, height: 120, stride: 160, format: PixelFormat::Grey as u32 };
    let (mut state, mut score, mut picture) = (State::new(Parameters::default()), Score::default(), Picture::default());
    for number in 1..=120 {
        let time_s = number as f64 / 15.0;
        let (robot, covered_m) = pose(time_s);
        camera.take_from(number, &Moment { time_s, robot, covered_m }, &mut picture);
        state.step(&Frame { stamp_ns: number * 66_666_667, layout, bytes: &picture.grey, odometry: None });
        if number > 30 {
            let truth = Plane::from_values(160, 120, std::mem::take(&mut picture.labels)).unwrap();
            score.add(&state.mask().unwrap(), &truth);
        }
    }
    score
}

/// How the robot moves.
#[derive(Debug, Clone, Copy)]
enum Motion {
    Standing,
    Turning,
    Driving,
}

impl Motion {
    /// Pose and distance covered at this time.
    fn at(self, time_s: f64) -> (Pose, f64) {
        let moving_s = (time_s - 1.0).max(0.0);
        match self {
            Self::Standing => (Pose::default(), 0.0),
            Self::Turning => (Pose { yaw_rad: 20_f64.to_radians() * (0.8 * moving_s).sin(), ..Pose::default() }, 0.0),
            Self::Driving => (Pose { x_m: 0.25 * moving_s, ..Pose::default() }, 0.25 * moving_s),
        }
    }
}

/// What background subtraction reaches: seed, motion, the least F1 score, and the most false blobs in the 90 frames that are scored. The
/// figures may only improve. A driving robot that passes posters closely takes them for walkers.
const REACHED: [(u64, Motion, f64, u32); 6] = [
    (1, Motion::Standing, 0.926, 0),
    (1, Motion::Turning, 0.845, 0),
    (1, Motion::Driving, 0.821, 43),
    (2, Motion::Standing, 0.920, 0),
    (2, Motion::Turning, 0.817, 0),
    (2, Motion::Driving, 0.834, 22),
];

#[test]
fn background_subtraction_works_on_its_pictures() {
    for (seed, motion, least_f1, most_false_blobs) in REACHED {
        let score = score(seed, |time_s| motion.at(time_s));
        let false_blobs = (score.false_blobs_per_frame() * 90.0).round() as u32;
        let what = format!("{motion:?} with seed {seed}: F1 {:.4}, {false_blobs} false blobs", score.f1());
        assert!(score.f1() >= least_f1 && false_blobs <= most_false_blobs, "{what}, expected {least_f1} and {most_false_blobs}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn without_walkers_the_truth_is_empty(x_m in -2.0..16.0, y_m in -1.2..1.2, yaw_rad in -7.0..7.0, seed in 0_u64..9) {
        let mut picture = Picture::default();
        let mut camera = Camera::new(&world(CORRIDOR), &optics([80, 60]), &Flaws::default(), seed);
        camera.take_from(1, &at(3.0, Pose { x_m, y_m, yaw_rad }), &mut picture);
        prop_assert!(picture.labels.iter().all(|label| *label == LABEL_BACKGROUND));
        prop_assert_eq!(picture.grey.len(), 80 * 60);
    }

    #[test]
    fn no_place_and_no_camera_is_too_odd(
        pose in (any::<f64>(), any::<f64>(), any::<f64>()),
        near in (-3.0..17.0, -3.0..3.0),
        height_m in 0.05..3.0,
        horizon_share in -1.0..2.0,
        view_deg in 15.0..160.0_f64,
        time_s in 0.0..20.0,
    ) {
        let optics = Optics { height_m, horizon_share, field_of_view_rad: view_deg.to_radians(), ..optics([80, 60]) };
        let mut camera = Camera::new(&world(&format!("{CORRIDOR}{WALKERS}")), &optics, &Flaws::default(), 1);
        let mut picture = Picture::default();
        for robot in [Pose { x_m: pose.0, y_m: pose.1, yaw_rad: pose.2 }, Pose { x_m: near.0, y_m: near.1, yaw_rad: pose.2 }] {
            camera.take_from(1, &at(time_s, robot), &mut picture);
            prop_assert_eq!((picture.grey.len(), picture.labels.len()), (80 * 60, 80 * 60));
        }
    }
}
