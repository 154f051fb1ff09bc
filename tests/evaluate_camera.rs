//! `stillmap evaluate camera`: foreground masks scored against the truth, outputs for people, and unusable files.

use std::path::{Path, PathBuf};

use serde_json::Value;

use crate::harness::Sandbox;

const WIDTH: usize = 80;
const HEIGHT: usize = 60;

/// A textured wall with a dark square that walks in front of it from frame 20 on, and the truth: luminance and labels of each frame.
fn sequence(count: usize) -> Vec<[Vec<u8>; 2]> {
    let mut noise = 1_u32;
    let mut random = || {
        noise = noise.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        noise >> 24
    };
    let wall: Vec<u8> = (0..WIDTH * HEIGHT).map(|_| 100 + (random() / 4) as u8).collect();
    (0..count)
        .map(|n| {
            let (mut luma, mut labels) = (wall.clone(), vec![0; WIDTH * HEIGHT]);
            luma.iter_mut().for_each(|z| *z += (random() % 4) as u8);
            for (at, (z, label)) in luma.iter_mut().zip(&mut labels).enumerate() {
                let (u, v) = (at % WIDTH, at / WIDTH);
                if n >= 20 && (n - 10..n + 10).contains(&u) && (15..45).contains(&v) {
                    (*z, *label) = (20 + (random() / 8) as u8, 255);
                }
            }
            [luma, labels]
        })
        .collect()
}

/// Writes a Y4M file with so many bytes of chroma in each frame.
fn write(path: &Path, header: &str, frames: impl IntoIterator<Item = Vec<u8>>, chroma: usize) {
    let mut bytes = format!("YUV4MPEG2 {header}\n").into_bytes();
    for frame in frames {
        bytes.extend(b"FRAME\n");
        bytes.extend(frame);
        bytes.extend(std::iter::repeat_n(128, chroma));
    }
    std::fs::write(path, bytes).unwrap();
}

/// Both files of a sequence.
fn files(sandbox: &Sandbox, count: usize) -> [PathBuf; 2] {
    let paths = [sandbox.path("frames.y4m"), sandbox.path("labels.y4m")];
    for (k, path) in paths.iter().enumerate() {
        write(path, "W80 H60 F15:1 Cmono", sequence(count).into_iter().map(|pair| pair[k].clone()), 0);
    }
    paths
}

fn evaluate(sandbox: &Sandbox, frames: &Path, labels: &Path, more: &[&str]) -> Result<Value, String> {
    let mut arguments = vec!["evaluate", "camera", frames.to_str().unwrap(), labels.to_str().unwrap(), "--json"];
    arguments.extend(more);
    let ended = sandbox.output(&arguments);
    match ended.code {
        Some(0) => Ok(serde_json::from_str(&ended.stdout).unwrap()),
        Some(2) => Err(ended.stderr),
        other => panic!("{other:?}: {}", ended.stderr),
    }
}

#[test]
fn a_walking_square_scores_above_ninety_percent() {
    let sandbox = Sandbox::new();
    let [frames, labels] = files(&sandbox, 50);
    let score = evaluate(&sandbox, &frames, &labels, &[]).unwrap();
    let number = |key: &str| score[key].as_f64().unwrap_or_else(|| panic!("{key} is missing in {score}"));
    assert!(number("f1") > 0.9 && number("precision") > 0.9 && number("recall") > 0.9, "{score}");
    assert!(number("false_blobs_per_frame") < 0.05 && number("shadow_as_foreground") == 0.0, "{score}");
    assert!(number("ms_per_frame") > 0.0);
    assert_eq!((&score["frames"], &score["frames_scored"]), (&50.into(), &20.into()), "frames 30 to 119 are scored");
    let chosen = evaluate(&sandbox, &frames, &labels, &["--frames", "40..44"]).unwrap();
    assert_eq!(chosen["frames_scored"], 5);
    let by_landmarks = evaluate(&sandbox, &frames, &labels, &["--compensation", "icp", "--horizon", "0"]).unwrap();
    assert!(by_landmarks["f1"].as_f64().unwrap() > 0.9, "{by_landmarks}");
}

#[test]
fn all_colour_spaces_score_the_same() {
    let sandbox = Sandbox::new();
    let [frames, labels] = files(&sandbox, 40);
    let score = |frames: &Path| {
        let mut score = evaluate(&sandbox, frames, &labels, &[]).unwrap();
        score["ms_per_frame"] = Value::Null;
        score
    };
    let mono = score(&frames);
    for (colour, chroma) in [("420jpeg", WIDTH * HEIGHT / 2), ("422", WIDTH * HEIGHT), ("444", 2 * WIDTH * HEIGHT)] {
        let path = sandbox.path(colour);
        write(&path, &format!("W80 H60 C{colour}"), sequence(40).into_iter().map(|[luma, _]| luma), chroma);
        assert_eq!(score(&path), mono, "{colour}");
    }
}

#[test]
fn scored_frames_are_written_as_pictures_and_log() {
    let sandbox = Sandbox::new();
    let [frames, labels] = files(&sandbox, 40);
    let out = sandbox.path("new/out");
    evaluate(&sandbox, &frames, &labels, &["--frames", "35..37", "--out", out.to_str().unwrap()]).unwrap();
    let mut names: Vec<String> = std::fs::read_dir(&out).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    assert_eq!(names, ["camera.mcap", "frame_00035.png", "frame_00036.png", "frame_00037.png"]);

    let [frame, truth] = sequence(40).swap_remove(36);
    let picture = image::open(out.join("frame_00036.png")).unwrap().into_luma8();
    assert_eq!((picture.width() as usize, picture.height() as usize), (3 * WIDTH + 8, HEIGHT));
    let part = |left: usize| -> Vec<u8> {
        let rows = picture.as_raw().chunks(3 * WIDTH + 8);
        rows.flat_map(|row| row[left..left + WIDTH].to_vec()).collect()
    };
    assert_eq!((part(0), part(2 * WIDTH + 8)), (frame, truth));
    let mask = part(WIDTH + 4);
    assert!(mask.iter().all(|p| matches!(p, 0 | 255)) && mask.contains(&255));

    let log = std::fs::read(out.join("camera.mcap")).unwrap();
    let messages: Vec<mcap::Message<'_>> = mcap::MessageStream::new(&log).unwrap().map(Result::unwrap).collect();
    let topics: Vec<&str> = messages.iter().map(|m| m.channel.topic.as_str()).collect();
    assert_eq!(topics, ["camera/frame", "camera/mask", "camera/truth"].repeat(3));
    assert!(messages.iter().all(|m| m.channel.schema.as_ref().unwrap().name == "foxglove.RawImage"));
    assert_eq!(messages[3].log_time, 37 * 66_666_666);
    let found: foxglove::messages::RawImage = foxglove::Decode::decode(&messages[4].data[..]).unwrap();
    assert_eq!((found.width, found.height, found.step, found.encoding.as_str()), (80, 60, 80, "mono8"));
    assert_eq!(found.data, mask);
}

#[test]
fn unusable_files_are_refused_with_name_and_place() {
    let sandbox = Sandbox::new();
    let [frames, labels] = files(&sandbox, 40);
    let check = |frames: &Path, labels: &Path, more: &[&str], expected: &[&str]| {
        let said = evaluate(&sandbox, frames, labels, more).unwrap_err();
        assert_eq!(said.lines().count(), 1, "{said}");
        for word in expected {
            assert!(said.contains(word), "{word:?} is missing in {said:?}");
        }
    };
    let broken = sandbox.path("broken.y4m");
    check(&sandbox.path("nowhere.y4m"), &labels, &[], &["nowhere.y4m"]);
    std::fs::write(&broken, "RIFF").unwrap();
    check(&broken, &labels, &[], &["broken.y4m: at byte 0", "RIFF", "YUV4MPEG2"]);
    write(&broken, "W80 H60 C420p10", [], 0);
    check(&broken, &labels, &[], &["broken.y4m: at byte 18", "C420p10", "8-bit"]);
    write(&broken, "W80 H20 Cmono", [], 0);
    check(&broken, &labels, &[], &["broken.y4m: pictures of 80 × 20", "80 × 60 to 640 × 480"]);
    write(&broken, "W96 H60 Cmono", [], 0);
    check(&frames, &broken, &[], &["broken.y4m: pictures of 96 × 60", "80 × 60 as in", "frames.y4m"]);
    write(&broken, "W80 H60 Cmono", sequence(39).into_iter().map(|[_, labels]| labels), 0);
    check(&frames, &broken, &[], &["broken.y4m: ends after 39 frames", "frames.y4m"]);
    let bytes = std::fs::read(&frames).unwrap();
    std::fs::write(&broken, &bytes[..bytes.len() - 7]).unwrap();
    check(&broken, &labels, &[], &["broken.y4m: at byte", "7 bytes before the end of frame 39"]);
    check(&frames, &labels, &["--frames", "100..119"], &["labels.y4m: no pixel to score", "100 to 119 of 40", "--frames"]);
}
