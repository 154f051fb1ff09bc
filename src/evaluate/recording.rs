//! Scores the drive of a log.

use super::chain::chain;
use crate::exit::BadInput;
use crate::process::robot;
use crate::replay::recorded_settings;
use drivelog::{Entry, Log, Logged};
use evaluate::{Chain, Drive, Numbered, Occupancy, Recorded, Trial, reference};
use settings::Settings;
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

/// Scores a run, given its log or its folder.
pub(crate) fn score(run: &Path) -> anyhow::Result<Scored> {
    let log = if run.is_dir() { run.join(LOG) } else { run.to_owned() };
    let text = Log::open(&log)?.preamble().settings.clone();
    let settings = recorded_settings(&log, &text)?;
    let recorded = read(&log)?;
    let (drive, outcome) = recorded.assemble().map_err(|error| BadInput(format!("{}: {error}", log.display())))?;
    let chain = chain(&settings);
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
