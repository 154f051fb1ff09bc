//! Scores SBS on sequences with truth: `score [key=value ...] PREFIX ...` reads `PREFIX.frames.y4m` and `PREFIX.labels.y4m`.
//!
//! Keys are parameters (see `set`), `from` and `to`, the first and last frame scored, and `dump`, a folder for raw pictures (frame,
//! truth, mask, background of each frame).
#![allow(clippy::print_stdout, reason = "a command")]

use std::fs::File;
use std::io::{BufReader, Write};

use anyhow::{Context, Result, bail};
use messages::{CameraStatus, FrameLayout, PixelFormat};
use stillmap_sbs::plane::Plane;
use stillmap_sbs::score::Score;
use stillmap_sbs::transform::Class;
use stillmap_sbs::y4m::Y4mReader;
use stillmap_sbs::{Frame, Method, Parameters, State};

/// What is scored and how.
struct Options {
    parameters: Parameters,
    from: u64,
    to: u64,
    dump: Option<String>,
    prefixes: Vec<String>,
}

fn main() -> Result<()> {
    let options = options()?;
    println!(
        "{:28} {:>6} {:>9} {:>6} {:>11} {:>6} {:>6} {:>15}",
        "", "f1", "precision", "recall", "false_blobs", "shadow", "ms", "not_compensated"
    );
    for prefix in &options.prefixes {
        score(prefix, &options)?;
    }
    Ok(())
}

fn options() -> Result<Options> {
    let mut options = Options { parameters: Parameters::default(), from: 30, to: 119, dump: None, prefixes: Vec::new() };
    for argument in std::env::args().skip(1) {
        match argument.split_once('=') {
            None => options.prefixes.push(argument),
            Some(("from", value)) => options.from = value.parse()?,
            Some(("to", value)) => options.to = value.parse()?,
            Some(("dump", value)) => options.dump = Some(value.to_owned()),
            Some((key, value)) => set(&mut options.parameters, key, value.parse().with_context(|| argument.clone())?)?,
        }
    }
    Ok(options)
}

fn set(s: &mut Parameters, key: &str, value: f32) -> Result<()> {
    match key {
        "method" => s.method = if value > 0.0 { Method::Icp } else { Method::Direct },
        "class" => {
            s.class = match value as u32 {
                0 => Class::Translation,
                1 => Class::Similarity,
                2 => Class::Affine,
                _ => Class::Homography,
            }
        }
        "horizon" => s.horizon = value,
        "training_frames" => s.training_frames = value as usize,
        "resample_px" => s.resample_px = value,
        "still_level" => s.still_level = value,
        "beta" => s.beta = f64::from(value),
        "lambda" => s.local.lambda = value,
        "mu" => s.local.mu = value,
        "reach_px" => s.local.reach_px = value,
        "model_share" => s.local.model_share = value,
        "scale" => s.local.scale = value,
        "k" => s.background.k = value,
        "sigma_min" => s.background.sigma_min = value,
        "sigma_max" => s.background.sigma_max = value,
        "sigma_start" => s.background.sigma_start = value,
        "clip" => s.background.clip = value,
        "count_cap" => s.background.count_cap = value as u8,
        "takeover" => s.background.takeover = value as u8,
        "takeover_still" => s.background.takeover_still = value as u8,
        "ratio_min" => s.shadow.ratio_min = value,
        "ratio_max" => s.shadow.ratio_max = value,
        "spread_max" => s.shadow.spread_max = value,
        "size_min" => s.blobs.size_min = value,
        "thickness_min" => s.blobs.thickness_min = value,
        "overlap_min" => s.blobs.overlap_min = value,
        "motion_min" => s.blobs.motion_min = value,
        "known_share" => s.blobs.known_share = value,
        "held_age" => s.blobs.held_age = value as u8,
        "firm_thickness_min" => s.blobs.firm_thickness_min = value,
        _ => bail!("no setting {key}"),
    }
    Ok(())
}

fn open(path: String) -> Result<Y4mReader<BufReader<File>>> {
    let file = File::open(&path).with_context(|| path.clone())?;
    Y4mReader::new(BufReader::new(file)).context(path)
}

fn score(prefix: &str, options: &Options) -> Result<()> {
    let (mut frames, mut labels) = (open(format!("{prefix}.frames.y4m"))?, open(format!("{prefix}.labels.y4m"))?);
    let (width, height) = (frames.width(), frames.height());
    let layout = FrameLayout { width: width as u32, height: height as u32, stride: width as u32, format: PixelFormat::Grey as u32 };
    let name = prefix.rsplit('/').next().unwrap_or(prefix);
    let mut dump = options.dump.as_ref().map(|folder| File::create(format!("{folder}/{name}.raw"))).transpose()?;
    let (mut state, mut score) = (State::new(options.parameters.clone()), Score::default());
    let (mut bytes, mut truth) = (Vec::new(), Vec::new());
    let (mut number, mut not_compensated, mut times) = (0_u64, 0_u64, Vec::new());
    while frames.read(&mut bytes)? && labels.read(&mut truth)? {
        let begin = std::time::Instant::now();
        let answer = state.step(&Frame { stamp_ns: (number + 1) * 66_666_667, layout, bytes: &bytes, odometry: None });
        times.push(begin.elapsed().as_secs_f64());
        not_compensated += u64::from(answer.motion.status == CameraStatus::NotCompensated as u32);
        let (Some(mask), Some(background)) = (state.mask(), state.background()) else { bail!("{:?}", answer.remark) };
        if let Some(file) = &mut dump {
            for plane in [&bytes[..], &truth, mask.values(), mask.values(), background.values()] {
                file.write_all(plane)?;
            }
        }
        if (options.from..=options.to).contains(&number) {
            let truth = Plane::from_values(labels.width(), labels.height(), std::mem::take(&mut truth)).context("size of the labels")?;
            score.add(&mask, &truth);
        }
        number += 1;
    }
    let (f1, precision, recall, blobs) = (score.f1(), score.precision(), score.recall(), score.false_blobs_per_frame());
    // The median: the machine may be busy with other things.
    times.sort_by(f64::total_cmp);
    let (shadow, ms) = (score.shadow_as_foreground(), 1e3 * times.get(times.len() / 2).copied().unwrap_or(0.0));
    println!("{name:28} {f1:6.3} {precision:9.3} {recall:6.3} {blobs:11.3} {shadow:6.3} {ms:6.2} {not_compensated:15}");
    Ok(())
}
