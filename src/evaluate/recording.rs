//! Scores the drive of a log, or what the present filter makes of it.

use super::chain::chain;
use crate::exit::BadInput;
use crate::process::{robot, sbs};
use crate::replay::recorded_settings;
use drivelog::{Entry, Image, Log, Logged};
use evaluate::{Chain, Drive, Frame, Numbered, Occupancy, Recorded, Trial, filter, reference};
use messages::{CameraFrame, CameraMotion};
use settings::{BuiltIn, Settings};
use simulator::World;
use std::path::Path;

/// Names of the log in the folder of a run, and of the world that the demo writes beside it.
const LOG: &str = "drive.mcap";
const WORLD: &str = "world.toml";

/// The score of a recorded drive.
pub(crate) struct Scored {
    pub(crate) trial: Trial,
    /// The file of the world was found, to simulate the drive without walkers.
    pub(crate) with_reference: bool,
}

/// Scores a run, given its log or its folder: the recorded verdicts, or those of a replay in this process.
pub(crate) fn score(run: &Path, replay: bool) -> anyhow::Result<Scored> {
    let log = if run.is_dir() { run.join(LOG) } else { run.to_owned() };
    let text = Log::open(&log)?.preamble().settings.clone();
    let settings = recorded_settings(&log, &text)?;
    let recorded = read(&log)?;
    let (mut drive, mut outcome) = recorded.assemble().map_err(|error| BadInput(format!("{}: {error}", log.display())))?;
    let chain = chain(&settings);
    if replay {
        drive.frames = if settings.recorder.pictures && settings.runs(BuiltIn::Sbs) { frames(&log, &settings)? } else { motions(&log)? };
        outcome = filter(&drive, &chain)?;
    }
    let reference = without_walkers(&log, &settings, &chain)?;
    let trial = Trial::judge(&drive, &outcome, reference.as_ref(), &chain)?;
    Ok(Scored { trial, with_reference: reference.is_some() })
}

fn read(log: &Path) -> anyhow::Result<Recorded> {
    Ok(Recorded {
        scans: stream(log)?,
        motions: stream(log)?,
        walkers: stream(log)?,
        verdicts: stream(log)?,
        truth: stream(log)?,
        surfaces: stream(log)?.into_iter().map(|(_, _, surfaces)| surfaces).collect(),
    })
}

/// Every message of one stream. Damaged parts of the log are skipped.
fn stream<T: Logged>(log: &Path) -> anyhow::Result<Vec<Numbered<T>>> {
    let mut log = Log::open(log)?;
    let mut messages = Vec::new();
    while let Some(entry) = log.next_of()? {
        if let Entry::Message { seq, stamp_ns, payload } = entry {
            messages.push((seq, stamp_ns, payload));
        }
    }
    Ok(messages)
}

/// What SBS makes of the recorded pictures.
fn frames(log: &Path, settings: &Settings) -> anyhow::Result<Vec<Frame>> {
    let mut log = Log::open(log)?;
    let mut state = ::sbs::State::new(sbs::parameters(settings));
    let mut frames = Vec::new();
    while let Some(entry) = log.next_picture::<CameraFrame>()? {
        if let Entry::Message { stamp_ns, payload: Image { layout, bytes }, .. } = entry {
            let answer = state.step(&::sbs::Frame { stamp_ns, layout, bytes: &bytes, odometry: None });
            frames.push(Frame { stamp_ns, motion: answer.motion });
        }
    }
    Ok(frames)
}

/// The recorded motion of the camera.
fn motions(log: &Path) -> anyhow::Result<Vec<Frame>> {
    let motions = stream::<CameraMotion>(log)?.into_iter();
    Ok(motions.map(|(_, stamp_ns, motion)| Frame { stamp_ns, motion }).collect())
}

/// The map of the same drive without walkers, if the file of the world is found.
fn without_walkers(log: &Path, settings: &Settings, chain: &Chain) -> anyhow::Result<Option<Occupancy>> {
    let beside = log.with_file_name(WORLD);
    let Some(path) = [&settings.simulator.world, &beside].into_iter().find(|path| path.is_file()) else { return Ok(None) };
    let drive = empty_drive(path, settings)?;
    Ok(Some(reference(&drive, &chain.mapping)?))
}

fn empty_drive(path: &Path, settings: &Settings) -> anyhow::Result<Drive> {
    let mut world: World = world_file::read(path)?;
    world.walkers.clear();
    let body = robot::body(&settings.robot);
    Ok(Drive::through(&world, &body, settings.robot.range_limit_m.get(), None, u64::from(settings.simulator.seed.get())))
}
