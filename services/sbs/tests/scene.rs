//! What SBS makes of a wall and a figure: compensation, blobs, formats, restart.
#![allow(clippy::unwrap_used, clippy::panic, reason = "tests fail by panicking")]

mod common;

use common::{Figure, grey, picture, step};
use messages::{CameraStatus, FrameLayout, Payload, PixelFormat};
use stillmap_sbs::transform::{Class, Transform};
use stillmap_sbs::{Frame, Method, Odometry, Parameters, State};

/// A camera that pans right, so that the wall goes left, and a figure that walks right.
fn panning(width: usize, height: usize, n: u64) -> Vec<u8> {
    let t = n as f64;
    picture(width, height, [0.8 * t, 0.3 * t], (n >= 5).then(|| walker(width, height, n)), n)
}

fn walker(width: usize, height: usize, n: u64) -> Figure {
    let unit = width as f64 / 160.0;
    [(30.0 + 2.0 * n as f64) * unit, 0.3 * height as f64, 22.0 * unit, 0.5 * height as f64]
}

/// Intersection over union of the mask and the figure.
fn overlap(state: &State, [left, top, w, h]: Figure) -> f64 {
    let mask = state.mask().unwrap();
    let (mut both, mut either) = (0, 0);
    for v in 0..mask.height() {
        for u in 0..mask.width() {
            let (x, y) = (u as f64, v as f64);
            let truth = (left..left + w).contains(&x) && (top..top + h).contains(&y);
            let found = mask.row(v)[u] != 0;
            both += u32::from(truth && found);
            either += u32::from(truth || found);
        }
    }
    f64::from(both) / f64::from(either.max(1))
}

/// The figure is found and T is the camera's motion, in pictures of any size and with every way of finding T.
fn check(width: usize, height: usize, parameters: Parameters) {
    let name = format!("{width} × {height}, {:?} {:?}", parameters.method, parameters.class);
    let mut state = State::new(parameters);
    for n in 0..30 {
        let answer = step(&mut state, n, grey(width, height), &panning(width, height, n));
        answer.motion.validate().unwrap();
        if n < 12 {
            continue;
        }
        assert_eq!(answer.motion.status, CameraStatus::Compensated as u32, "{name}, frame {n}");
        let [_, _, du, _, _, dv, ..] = answer.motion.transform;
        // Motion is estimated in a picture about 160 wide.
        let tolerance = 0.12 * (width as f64 / 160.0).max(1.0);
        assert!((du - 0.8).abs() < tolerance && (dv - 0.3).abs() < tolerance, "{name}, frame {n}: T moves by {du:.2}, {dv:.2}");
        assert_eq!(answer.motion.count, 1, "{name}, frame {n}: {:?}", answer.motion.blobs());
        let found = overlap(&state, walker(width, height, n));
        assert!(found > 0.7, "{name}, frame {n}: overlap {found:.2}");
    }
}

#[test]
fn a_walker_before_a_panning_camera_is_found() {
    for (width, height) in [(80, 60), (161, 121), (160, 120), (320, 240), (640, 480)] {
        check(width, height, Parameters { horizon: 1.0, ..Parameters::default() });
    }
}

#[test]
fn every_method_and_class_finds_it() {
    for class in [Class::Translation, Class::Similarity, Class::Affine, Class::Homography] {
        for method in [Method::Direct, Method::Icp] {
            check(160, 120, Parameters { horizon: 1.0, class, method, ..Parameters::default() });
        }
    }
}

#[test]
fn a_still_scene_has_no_blobs_and_says_so() {
    let mut state = State::new(Parameters::default());
    for n in 0..40 {
        let answer = step(&mut state, n, grey(160, 120), &picture(160, 120, [0.0, 0.0], None, n));
        assert_eq!(answer.motion.count, 0, "frame {n}");
        let expected = if n < 15 { CameraStatus::Learning } else { CameraStatus::Compensated };
        assert_eq!(answer.motion.status, expected as u32, "frame {n}");
        let identity = Transform::identity().rows();
        assert!(
            answer.motion.transform.iter().zip(identity).all(|(a, b)| (a - b).abs() < 1e-12),
            "frame {n}: {:?}",
            answer.motion.transform
        );
    }
}

#[test]
fn someone_who_passes_close_by_does_not_bend_the_model() {
    let mut state = State::new(Parameters { horizon: 1.0, ..Parameters::default() });
    for n in 0..60 {
        // 100 of 160 columns at its widest, all rows.
        let left = -100.0 + 6.0 * n as f64;
        let bytes = picture(160, 120, [0.0, 0.0], Some([left, 0.0, 100.0, 120.0]), n);
        let [_, _, du, _, _, dv, ..] = step(&mut state, n, grey(160, 120), &bytes).motion.transform;
        assert!(du.abs() < 0.05 && dv.abs() < 0.05, "frame {n}: T moves by {du:.2}, {dv:.2}");
    }
    let wall = picture(160, 120, [0.0, 0.0], None, 99);
    let background = state.background().unwrap();
    let wrong = background.values().iter().zip(&wall).filter(|(b, w)| b.abs_diff(**w) > 12).count();
    assert!(wrong < 160 * 120 / 100, "{wrong} pixels of the background picture differ from the wall");
}

#[test]
fn the_background_picture_is_the_wall_behind_the_walker() {
    let mut state = State::new(Parameters { horizon: 1.0, ..Parameters::default() });
    for n in 0..30 {
        step(&mut state, n, grey(160, 120), &panning(160, 120, n));
    }
    let wall = picture(160, 120, [0.8 * 29.0, 0.3 * 29.0], None, 29);
    let background = state.background().unwrap();
    let wrong = background.values().iter().zip(&wall).filter(|(b, w)| b.abs_diff(**w) > 12).count();
    assert!(wrong < 160 * 120 / 25, "{wrong} pixels of the background picture differ from the wall");
}

#[test]
fn yuyv_and_rgb_are_taken_as_grey() {
    let parameters = Parameters { horizon: 1.0, ..Parameters::default() };
    let mut states = [State::new(parameters.clone()), State::new(parameters.clone()), State::new(parameters)];
    for n in 0..20 {
        let bytes = panning(160, 120, n);
        let yuyv: Vec<u8> = bytes.iter().flat_map(|&y| [y, 128]).collect();
        let rgb: Vec<u8> = bytes.chunks(160).flat_map(|row| row.iter().flat_map(|&y| [y, y, y]).chain([7; 20])).collect();
        let layout = |format: PixelFormat, stride: u32| FrameLayout { width: 160, height: 120, stride, format: format as u32 };
        let answers = [
            step(&mut states[0], n, grey(160, 120), &bytes),
            step(&mut states[1], n, layout(PixelFormat::Yuyv, 320), &yuyv),
            step(&mut states[2], n, layout(PixelFormat::Rgb, 500), &rgb),
        ];
        assert_eq!(answers[0], answers[1], "frame {n}, YUYV");
        let (grey, rgb) = (answers[0].motion, answers[2].motion);
        assert_eq!((grey.status, grey.count), (rgb.status, rgb.count), "frame {n}, RGB");
    }
}

#[test]
fn odometry_leads_where_the_picture_alone_would_get_lost() {
    // 14 px a frame is beyond what the pyramid finds from standstill, and the way back and forth defeats prediction.
    let focal_px = 80.0 / 35.0_f64.to_radians().tan();
    let shift = |n: u64| if n.is_multiple_of(2) { 0.0 } else { 14.0 };
    let mut state = State::new(Parameters::default());
    for n in 0..8 {
        // The scene moves left (the camera looks further right) by `shift`: yaw falls.
        let yaw_rad = -(shift(n) / focal_px).atan();
        let bytes = picture(160, 120, [shift(n), 0.0], None, n);
        let odometry = Some(Odometry { yaw_rad });
        let answer = state.step(&Frame { stamp_ns: n + 1, layout: grey(160, 120), bytes: &bytes, odometry });
        let expected = if n == 0 { 0.0 } else { shift(n) - shift(n - 1) };
        assert!((answer.motion.transform[2] - expected).abs() < 0.3, "frame {n}: {:?}", answer.motion.transform);
    }
}

#[test]
fn a_restored_state_ends_in_equal_bytes() {
    for (cut, pan) in [(3, 0.0), (10, 0.0), (20, 0.0), (3, 0.8), (20, 0.8)] {
        let mut state = State::new(Parameters::default());
        let frame = |n: u64| picture(160, 120, [pan * n as f64, 0.0], (n >= 5).then(|| walker(160, 120, n)), n);
        for n in 0..cut {
            step(&mut state, n, grey(160, 120), &frame(n));
        }
        let bytes = state.save();
        let mut restored = State::restore(Parameters::default(), &bytes).unwrap();
        assert_eq!(restored.save(), bytes, "cut at {cut}");
        for n in cut..cut + 15 {
            let (a, b) = (step(&mut state, n, grey(160, 120), &frame(n)), step(&mut restored, n, grey(160, 120), &frame(n)));
            assert_eq!(a, b, "cut at {cut}, frame {n}");
        }
        assert_eq!(state.mask(), restored.mask());
        assert!(state.save() == restored.save(), "cut at {cut}: the states differ in the end");
    }
}
