//! Frames that lie and bytes that are no state: refused or survived, with a status that says which.
#![allow(clippy::unwrap_used, clippy::panic, reason = "tests fail by panicking")]

mod common;

use common::{PERIOD_NS, grey, picture, step};
use messages::{CameraStatus, FrameLayout, Payload};
use proptest::prelude::*;
use state::DecodeError;
use stillmap_sbs::{CheckpointError, Frame, FrameError, Odometry, Parameters, Remark, State};

/// A state that has seen `count` frames of a still wall.
fn seasoned(count: u64) -> State {
    let mut state = State::new(Parameters::default());
    for n in 0..count {
        step(&mut state, n, grey(160, 120), &wall(n));
    }
    state
}

fn wall(n: u64) -> Vec<u8> {
    picture(160, 120, [0.0, 0.0], None, n)
}

/// The frame is refused, the error is the expected one, and the state is as before: the next good frame is compensated.
fn check_refused(name: &str, layout: FrameLayout, bytes: &[u8], expected: impl Fn(&FrameError) -> bool) {
    let mut state = seasoned(20);
    let before = state.save();
    let answer = step(&mut state, 20, layout, bytes);
    answer.motion.validate().unwrap();
    assert_eq!(answer.motion.status, CameraStatus::Refused as u32, "{name}");
    assert_eq!(answer.motion.count, 0, "{name}");
    match &answer.remark {
        Remark::Refused(error) => assert!(expected(error), "{name}: {error:?}"),
        other => panic!("{name}: {other:?}"),
    }
    assert!(state.save() == before, "{name}: the state has changed");
    let next = step(&mut state, 21, grey(160, 120), &wall(21));
    assert_eq!((next.motion.status, next.motion.count), (CameraStatus::Compensated as u32, 0), "{name}: the next frame");
}

#[test]
fn frames_that_lie_are_refused() {
    let good = wall(20);
    let layout = grey(160, 120);
    check_refused("too few bytes", layout, &good[..good.len() - 1], |r| matches!(r, FrameError::Layout(_)));
    check_refused("no bytes", layout, &[], |r| matches!(r, FrameError::Layout(_)));
    check_refused("unknown format", FrameLayout { format: 9, ..layout }, &good, |r| matches!(r, FrameError::Layout(_)));
    check_refused("stride below the row", FrameLayout { stride: 10, ..layout }, &good, |r| matches!(r, FrameError::Layout(_)));
    check_refused("no width", FrameLayout { width: 0, ..layout }, &good, |r| matches!(r, FrameError::Layout(_)));
    check_refused("too small", grey(40, 40), &good, |r| matches!(r, FrameError::Size { width: 40, height: 40 }));
    check_refused("one value", layout, &[93; 160 * 120], |r| matches!(r, FrameError::Uniform { value: 93 }));
    let mut bright: Vec<u8> = good.iter().map(|&z| z.saturating_mul(4)).collect();
    bright[0] = 10;
    check_refused("saturated", layout, &bright, |r| matches!(r, FrameError::Saturated { .. }));
}

#[test]
fn time_that_runs_backwards_is_refused() {
    let mut state = seasoned(20);
    for stamp_ns in [0, 5 * PERIOD_NS, 20 * PERIOD_NS] {
        let answer = state.step(&Frame { stamp_ns, layout: grey(160, 120), bytes: &wall(20), odometry: None });
        let expected = Remark::Refused(FrameError::Time { stamp_ns, last_ns: 20 * PERIOD_NS });
        assert_eq!((answer.motion.status, answer.remark), (CameraStatus::Refused as u32, expected));
    }
}

#[test]
fn a_gap_of_three_seconds_is_survived() {
    let mut state = seasoned(20);
    let answer = step(&mut state, 20 + 45, grey(160, 120), &wall(20));
    assert_eq!((answer.motion.status, answer.motion.count), (CameraStatus::Compensated as u32, 0));
    assert!(matches!(answer.remark, Remark::Gap { seconds } if (3.0..3.2).contains(&seconds)), "{:?}", answer.remark);
}

#[test]
fn odometry_that_is_no_number_is_not_used() {
    let mut state = seasoned(20);
    for (n, yaw_rad) in [(20, f64::NAN), (21, f64::INFINITY)] {
        let odometry = Some(Odometry { yaw_rad });
        let answer = state.step(&Frame { stamp_ns: (n + 1) * PERIOD_NS, layout: grey(160, 120), bytes: &wall(n), odometry });
        assert_eq!((answer.motion.status, answer.remark), (CameraStatus::Compensated as u32, Remark::BadOdometry));
    }
}

#[test]
fn another_size_starts_anew() {
    let mut state = seasoned(20);
    let answer = step(&mut state, 20, grey(80, 60), &picture(80, 60, [0.0, 0.0], None, 0));
    assert_eq!((answer.motion.status, answer.remark), (CameraStatus::Learning as u32, Remark::NewSize));
    assert_eq!((answer.motion.width, answer.motion.height), (80, 60));
}

#[test]
fn one_spoilt_frame_is_skipped_and_three_restart_the_model() {
    let elsewhere = |n: u64| picture(160, 120, [5000.0 + 700.0 * n as f64, 900.0], None, n);
    let mut state = seasoned(20);
    let spoilt = step(&mut state, 20, grey(160, 120), &elsewhere(20));
    assert_eq!((spoilt.motion.status, spoilt.motion.count), (CameraStatus::NotCompensated as u32, 0));
    let next = step(&mut state, 21, grey(160, 120), &wall(21));
    assert_eq!((next.motion.status, next.motion.count), (CameraStatus::Compensated as u32, 0));
    let remarks: Vec<Remark> = (22..25).map(|n| step(&mut state, n, grey(160, 120), &elsewhere(n)).remark).collect();
    assert_eq!(remarks, [Remark::None, Remark::None, Remark::ModelRestarted]);
    let there = step(&mut state, 25, grey(160, 120), &elsewhere(24));
    assert_eq!((there.motion.status, there.motion.count), (CameraStatus::Compensated as u32, 0));
}

#[test]
fn another_version_and_cut_bytes_are_refused() {
    let bytes = seasoned(20).save();
    let error = |bytes: &[u8]| State::restore(Parameters::default(), bytes).err();
    assert_eq!(error(b""), Some(CheckpointError::Bytes(DecodeError::Short { found: 0 })));
    let mut other = bytes.clone();
    other[4] ^= 1;
    assert!(matches!(error(&other), Some(CheckpointError::Bytes(DecodeError::Version { .. }))));
    let mut long = bytes.clone();
    long.push(0);
    assert_eq!(error(&long), Some(CheckpointError::Bytes(DecodeError::Long { found: 1 })));
    for cut in (8..bytes.len()).step_by(9973) {
        assert!(matches!(error(&bytes[..cut]), Some(CheckpointError::Bytes(DecodeError::Damaged(_)))), "cut at {cut}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    /// A state of any bytes is refused, or takes the next frame.
    #[test]
    fn a_damaged_state_never_panics(damage in proptest::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..40)) {
        let mut bytes = seasoned(3).save();
        for (at, value) in damage {
            let at = at.index(bytes.len());
            bytes[at] = value;
        }
        if let Ok(mut state) = State::restore(Parameters::default(), &bytes) {
            let answer = state.step(&Frame { stamp_ns: u64::MAX, layout: grey(160, 120), bytes: &wall(3), odometry: None });
            prop_assert!(answer.motion.validate().is_ok());
        }
    }

    /// Any header over any bytes is answered with a valid message.
    #[test]
    fn any_frames_are_answered(
        frames in proptest::collection::vec((76_u32..90, 56_u32..70, 0_u32..400, 0_u32..4, any::<u64>(), any::<u8>(), any::<bool>()), 1..12),
    ) {
        let mut state = State::new(Parameters { training_frames: 3, ..Parameters::default() });
        let mut time = 0;
        for (width, height, stride, format, seed, value, noise) in frames {
            time += seed % 2_000_000_000;
            let layout = FrameLayout { width, height, stride, format };
            let mut x = seed | 1;
            let bytes: Vec<u8> = (0..stride as usize * height as usize)
                .map(|_| {
                    x = x.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
                    if noise { (x >> 56) as u8 } else { value }
                })
                .collect();
            let odometry = noise.then(|| Odometry { yaw_rad: f64::from_bits(seed) });
            let answer = state.step(&Frame { stamp_ns: time, layout, bytes: &bytes, odometry });
            prop_assert!(answer.motion.validate().is_ok(), "{answer:?}");
        }
    }
}
