//! `stillmap demo`: the built-in deployment. It needs no other file than the command.

use crate::args::RunOptions;
use crate::drive::{Driven, drive, once, place_output, print, unique_name};
use crate::evaluate::score_run;
use crate::{built_in, exit};
use clap::Args;
use indicatif::MultiProgress;
use settings::{BuiltIn, Settings};
use std::path::PathBuf;
use supervisor::Options;

/// Arguments of `stillmap demo`.
#[derive(Debug, Args)]
pub(crate) struct DemoArgs {
    #[command(flatten)]
    options: RunOptions,
    /// World to drive through instead of the built-in hall
    #[arg(long, value_name = "FILE")]
    world: Option<PathBuf>,
}

/// The demo takes about 15 s at this speed.
const SPEED: f64 = 5.0;
/// Speed with --open: walkers on the live page move slowly enough to follow.
const WATCHED_SPEED: f64 = 3.0;

/// Drives the simulated robot through the built-in world or another; the exit code.
pub(crate) fn demo(args: &DemoArgs, bars: &MultiProgress) -> anyhow::Result<u8> {
    let DemoArgs { options, world } = args;
    let mut settings = Settings::parse("demo.toml", built_in::DEMO)?;
    settings.name = unique_name("demo")?;
    settings.out = PathBuf::from("demo-out");
    place_output(&mut settings, options)?;
    let mut files = Vec::new();
    if let Some(path) = world {
        settings.simulator.world = std::path::absolute(path)?;
        crate::check::check_files(&settings)?;
    } else {
        settings.simulator.world = settings.out.join("world.toml");
        files.push((settings.simulator.world.clone(), built_in::HALL.to_owned()));
    }
    let speed = options.speed.unwrap_or(if options.open { WATCHED_SPEED } else { SPEED });
    tracing::info!("a simulated Pioneer 1 drives through a hall in which people walk, at {speed} times real time");
    tracing::info!("the supervisor restarts every process that fails: list them with `stillmap status` and try kill -9 on one");
    let Driven { exit_code, .. } = drive(&settings, &Options { files, ..once(speed)? }, options.open, bars)?;
    if exit_code == exit::SUCCESS && settings.runs(BuiltIn::Recorder) {
        let log = settings.out.join(settings.recorder.file.as_str());
        match score_run(&settings.out, &log) {
            Ok(figures) => {
                let comparison = settings.out.join("comparison.png");
                print(&[format!("ghosts     {figures}"), format!("           {}", comparison.display())]);
            }
            Err(error) => tracing::warn!("the map cannot be scored: {error}"),
        }
    }
    Ok(exit_code)
}
