//! `stillmap evaluate camera`: scores masks against labelled truth.

mod album;
mod sequence;

use crate::args::NumberRange;
use crate::exit::BadInput;
use crate::{output, progress};
use album::Album;
use anyhow::Result;
use clap::{Args, ValueEnum};
use indicatif::MultiProgress;
use messages::{CameraStatus, FrameLayout, PixelFormat};
use sbs::plane::Plane;
use sbs::score::Score;
use sbs::{Answer, Frame, FrameError, Parameters, Remark, State};
use sequence::Sequence;
use std::path::PathBuf;
use std::time::Instant;

/// What the printed figures mean, at the end of the long help.
const FIGURES: &str = "\
Figures:
  frames       Frames that were asked for, that the file has, and that have a pixel to score.
  f1           Harmonic mean of precision and recall over all scored pixels. Components of less
               than 40 pixels are dropped first; the limit holds for a width of 160 pixels and
               grows with the square of the width.
  false blobs  Components per frame that overlap moving or unscored truth by less than 30 %.
  shadow       Share of the shadow pixels that the mask marks as moving.
  time         Median processing time of a frame.
  motion       Frames whose camera motion was not found.
  refused      Frames that were rejected as unusable.";

#[derive(Debug, Clone, Args)]
#[command(after_long_help = FIGURES)]
pub(crate) struct CameraArgs {
    /// The pictures: a YUV4MPEG2 file with 8 bits, from 80 × 60 to 640 × 480 pixels
    #[arg(value_name = "FRAMES.y4m")]
    pub(crate) frames_file: PathBuf,
    /// The truth of each pixel: 0 static, 50 shadow, 85 and 170 not scored, 255 moving
    #[arg(value_name = "LABELS.y4m")]
    pub(crate) labels_file: PathBuf,
    /// Print JSON instead of text
    #[arg(long)]
    pub(crate) json: bool,
    /// Folder for pictures and a log of the frame, the mask and the truth of each scored frame; it is created if missing
    #[arg(long, value_name = "DIR")]
    pub(crate) out: Option<PathBuf>,
    /// Frames to score, counted from 0
    #[arg(long, value_name = "FIRST..LAST", default_value = "30..119")]
    pub(crate) frames: NumberRange,
    /// Row of the horizon as a share of the picture's height. Shadows are detected below it: 0 for a camera that looks down, 1 to detect none
    #[arg(long, value_name = "SHARE", default_value_t = 0.5, value_parser = share)]
    pub(crate) horizon: f32,
    /// Method that estimates the camera's own motion
    #[arg(long, value_enum, default_value_t = Compensation::Direct)]
    pub(crate) compensation: Compensation,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum Compensation {
    /// Direct alignment of all pixels by robust Gauss–Newton
    Direct,
    /// Iterative closest point over landmarks
    Icp,
}

impl From<Compensation> for sbs::Method {
    fn from(compensation: Compensation) -> Self {
        match compensation {
            Compensation::Direct => Self::Direct,
            Compensation::Icp => Self::Icp,
        }
    }
}

/// The result of a sequence.
#[derive(Debug, Default)]
struct Outcome {
    score: Score,
    frames: u64,
    not_compensated: u64,
    /// Number of refused frames, and the first of them with its reason.
    refused: u64,
    first_refused: Option<(u64, FrameError)>,
    /// Processing time of each frame, ms.
    times_ms: Vec<f64>,
}

/// Scores a sequence and prints the result.
pub(crate) fn camera(options: &CameraArgs, bars: &MultiProgress) -> Result<()> {
    let mut sequence = Sequence::open(&options.frames_file, &options.labels_file)?;
    let mut album = options.out.as_deref().map(Album::new).transpose()?;
    let parameters = Parameters { horizon: options.horizon, method: options.compensation.into(), ..Parameters::default() };
    let bar = progress::of_bytes(bars, sequence.bytes());
    let outcome = run(&mut sequence, album.as_mut(), parameters, options, |offset| bar.set_position(offset));
    bar.finish_and_clear();
    let outcome = outcome?;
    if let Some(album) = album {
        album.finish()?;
    }
    let (first, last) = (options.frames.first, options.frames.last);
    if outcome.score.frames == 0 {
        let (path, frames) = (options.labels_file.display(), outcome.frames);
        return Err(
            BadInput(format!("{path}: no pixel to score in frames {first} to {last} of {frames}: choose others with --frames")).into()
        );
    }
    if options.json {
        output::json(&json(&outcome).to_string())?
    } else {
        output::write(&text(&outcome, options))?
    }
    Ok(())
}

fn run(
    sequence: &mut Sequence,
    mut album: Option<&mut Album>,
    parameters: Parameters,
    options: &CameraArgs,
    progress: impl Fn(u64),
) -> Result<Outcome> {
    let (mut state, mut outcome) = (State::new(parameters), Outcome::default());
    let (width, height) = sequence.size();
    let layout = FrameLayout { width: width as u32, height: height as u32, stride: width as u32, format: PixelFormat::Grey as u32 };
    while let Some(pair) = sequence.next()? {
        let number = outcome.frames;
        let stamp_ns = (number + 1) * sequence.period_ns();
        let begin = Instant::now();
        let answer = state.step(&Frame { stamp_ns, layout, bytes: pair.frame.values(), odometry: None });
        let mask = state.mask();
        outcome.times_ms.push(begin.elapsed().as_secs_f64() * 1e3);
        let mask = outcome.note(&answer, mask).unwrap_or_else(|| Plane::filled(width, height, 0));
        if (options.frames.first..=options.frames.last).contains(&number) {
            outcome.score.add(&mask, &pair.truth);
            if let Some(album) = &mut album {
                album.add(number, stamp_ns, [&pair.frame, &mask, &pair.truth])?;
            }
        }
        progress(sequence.offset());
    }
    Ok(outcome)
}

impl Outcome {
    /// Counts an answer. Returns its mask, or `None` for a refused frame.
    fn note(&mut self, answer: &Answer, mask: Option<Plane<u8>>) -> Option<Plane<u8>> {
        let number = self.frames;
        self.frames += 1;
        self.not_compensated += u64::from(answer.motion.status == CameraStatus::NotCompensated as u32);
        if let Remark::Refused(reason) = &answer.remark {
            self.refused += 1;
            self.first_refused.get_or_insert((number, reason.clone()));
            return None;
        }
        mask
    }

    /// The median time: other programs may delay some frames.
    fn ms_per_frame(&self) -> f64 {
        let mut times = self.times_ms.clone();
        times.sort_by(f64::total_cmp);
        times.get(times.len() / 2).copied().unwrap_or_default()
    }
}

fn json(outcome: &Outcome) -> serde_json::Value {
    let score = &outcome.score;
    serde_json::json!({
        "f1": score.f1(),
        "precision": score.precision(),
        "recall": score.recall(),
        "false_blobs_per_frame": score.false_blobs_per_frame(),
        "shadow_as_foreground": score.shadow_as_foreground(),
        "ms_per_frame": outcome.ms_per_frame(),
        "frames": outcome.frames,
        "frames_scored": score.frames,
        "frames_not_compensated": outcome.not_compensated,
        "frames_refused": outcome.refused,
    })
}

fn text(outcome: &Outcome, options: &CameraArgs) -> String {
    let score = &outcome.score;
    let mut lines = vec![
        format!("frames       {} of {}, {} scored", options.frames, outcome.frames, score.frames),
        format!("f1           {:.3}: precision {:.3}, recall {:.3}", score.f1(), score.precision(), score.recall()),
        format!("false blobs  {:.3} a frame", score.false_blobs_per_frame()),
        format!("shadow       {:.3} of its {} pixels marked as moving", score.shadow_as_foreground(), score.shadow),
        format!("time         {:.2} ms a frame, the median", outcome.ms_per_frame()),
    ];
    if outcome.not_compensated > 0 {
        lines.push(format!("motion       not compensated in {} frames", outcome.not_compensated));
    }
    if let Some((number, reason)) = &outcome.first_refused {
        lines.push(format!("refused      {} frames, the first is {number}: {reason}", outcome.refused));
    }
    if let Some(out) = &options.out {
        lines.push(format!("pictures     {}", out.display()));
    }
    lines.push(String::new());
    lines.join("\n")
}

fn share(text: &str) -> Result<f32, String> {
    match text.parse::<f32>() {
        Ok(share) if (0.0..=1.0).contains(&share) => Ok(share),
        _ => Err("expected a number from 0 to 1".to_owned()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_share_lies_within_0_and_1() {
        assert_eq!(share("0.5"), Ok(0.5));
        for wrong in ["", "-0.1", "1.1", "nan", "half"] {
            assert!(share(wrong).is_err(), "{wrong}");
        }
    }
}
