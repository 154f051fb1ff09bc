//! `stillmap demo`: the built-in deployment, so that the one file of the command is enough.

use crate::args::RunOptions;
use crate::drive::{drive, once, place_output, unique_name};
use crate::evaluate::conclude;
use crate::exit::BadInput;
use crate::{built_in, exit, output};
use clap::Args;
use indicatif::MultiProgress;
use settings::{BuiltIn, Settings};
use std::path::{Path, PathBuf};

/// Arguments of `stillmap demo`.
#[derive(Debug, Args)]
pub(crate) struct DemoArgs {
    #[command(flatten)]
    options: RunOptions,
    /// World to drive through instead of the built-in hall
    #[arg(long, value_name = "FILE")]
    world: Option<PathBuf>,
}

/// Fast enough not to bore, slow enough to look at.
const SPEED: f64 = 5.0;
/// The same for somebody who watches the live page.
const WATCHED_SPEED: f64 = 3.0;

/// Drives the simulated robot through the built-in world or another; the exit code.
pub(crate) fn demo(args: &DemoArgs, bars: &MultiProgress) -> anyhow::Result<u8> {
    let DemoArgs { options, world } = args;
    let mut settings = Settings::parse("demo.toml", built_in::DEMO)?;
    settings.name = unique_name("demo")?;
    settings.out = PathBuf::from("demo-out");
    place_output(&mut settings, options)?;
    settings.simulator.world = match world {
        Some(path) => std::path::absolute(path)?,
        None => unpack_world(&settings.out)?,
    };
    crate::check::check_files(&settings)?;
    let speed = options.speed.unwrap_or(if options.open { WATCHED_SPEED } else { SPEED });
    tracing::info!("a simulated Pioneer 1 drives through a hall with people in it, {speed} times faster than a real one");
    tracing::info!("each process is watched and restarted: `stillmap status` shows them, kill -9 any of them and see");
    let code = drive(&settings, &once(speed)?, options.open, bars)?;
    if code == exit::SUCCESS && settings.runs(BuiltIn::Recorder) {
        let log = settings.out.join(settings.recorder.file.as_str());
        match conclude(&settings.out, &log) {
            Ok(figures) => {
                output::line(&format!("ghosts     {figures}"))?;
                output::line(&format!("           {}", settings.out.join("comparison.png").display()))?;
            }
            Err(error) => tracing::warn!("the map cannot be judged: {error}"),
        }
    }
    Ok(code)
}

fn unpack_world(folder: &Path) -> anyhow::Result<PathBuf> {
    let path = folder.join("world.toml");
    std::fs::write(&path, built_in::HALL).map_err(|error| BadInput(format!("{}: cannot be written: {error}", path.display())))?;
    Ok(path)
}
