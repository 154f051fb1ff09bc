//! The sequences with truth in `../shared/data`: what SBS must reach on them, with one set of parameters.
#![allow(clippy::unwrap_used, clippy::panic, clippy::print_stderr, reason = "tests fail by panicking and say what they skip")]

mod common;

use std::fs::File;
use std::io::BufReader;
use std::path::PathBuf;

use common::{grey, step};
use stillmap_sbs::plane::Plane;
use stillmap_sbs::score::Score;
use stillmap_sbs::y4m::Y4mReader;
use stillmap_sbs::{Parameters, State};

/// The score of the frames in a range; `None`, with a word, when the sequence is not there.
fn score(name: &str, frames: std::ops::RangeInclusive<u64>, parameters: Parameters) -> Option<Score> {
    let path = |kind: &str| -> PathBuf { format!("{}/../../../shared/data/{name}.{kind}.y4m", env!("CARGO_MANIFEST_DIR")).into() };
    let open = |kind: &str| File::open(path(kind)).map(|file| Y4mReader::new(BufReader::new(file)).unwrap());
    let (Ok(mut pictures), Ok(mut labels)) = (open("frames"), open("labels")) else {
        eprintln!("skipped: {} is not there", path("frames").display());
        return None;
    };
    let (mut state, mut score) = (State::new(parameters), Score::default());
    let (mut bytes, mut truth) = (Vec::new(), Vec::new());
    for n in 0..=*frames.end() {
        assert!(pictures.read(&mut bytes).unwrap() && labels.read(&mut truth).unwrap(), "{name} ends before frame {n}");
        step(&mut state, n, grey(pictures.width(), pictures.height()), &bytes);
        if frames.contains(&n) {
            let truth = Plane::from_values(labels.width(), labels.height(), truth.clone()).unwrap();
            score.add(&state.mask().unwrap(), &truth);
        }
    }
    Some(score)
}

/// At least this F1, at most so many false blobs a frame, less than 20 % of the shadow pixels called foreground.
fn check(name: &str, frames: std::ops::RangeInclusive<u64>, parameters: Parameters, f1: f64, false_blobs: f64) {
    let Some(score) = score(name, frames, parameters) else { return };
    let found = (score.f1(), score.false_blobs_per_frame(), score.shadow_as_foreground());
    assert!(found.0 >= f1, "{name}: F1 {:.3}, expected at least {f1}", found.0);
    assert!(found.1 <= false_blobs, "{name}: {:.3} false blobs a frame, expected at most {false_blobs}", found.1);
    assert!(found.2 < 0.2, "{name}: {:.3} of the shadow is called foreground", found.2);
}

#[test]
fn a_camera_that_stands_still() {
    check("sbs/corridor_still_160_1", 30..=119, Parameters::default(), 0.84, 0.05);
}

#[test]
fn a_camera_that_turns() {
    check("sbs/corridor_turn_160_1", 30..=119, Parameters::default(), 0.78, 0.1);
}

#[test]
fn a_camera_that_drives() {
    check("sbs/corridor_fwd_160_1", 30..=119, Parameters::default(), 0.77, 0.1);
    check("sbs/corridor_fwd_320_1", 30..=119, Parameters::default(), 0.77, 0.2);
}

#[test]
fn an_office_while_the_person_moves() {
    // Frames 102 to 180: a man walks in, stops and turns. The camera looks down on the desk: all of the picture may be in shadow.
    check("real_camera/office_160", 102..=180, Parameters { horizon: 0.0, ..Parameters::default() }, 0.85, 0.05);
    check("real_camera/office_160", 102..=180, Parameters::default(), 0.85, 0.05);
    // The man stands from frame 181 on and moves the arms: still a blob, until the background takes over what does not move for 4 s.
    check("real_camera/office_160", 90..=299, Parameters::default(), 0.85, 0.05);
}
