//! `stillmap run`: the deployment that a settings file describes.

use crate::args::RunOptions;
use crate::{check, drive};
use clap::Args;
use indicatif::MultiProgress;
use settings::BuiltIn;
use std::path::PathBuf;
use supervisor::Options;

/// Arguments of `stillmap run`.
#[derive(Debug, Args)]
pub(crate) struct RunArgs {
    /// The settings file
    #[arg(value_name = "FILE")]
    settings: PathBuf,
    /// Start a new map. Without this option a real robot resumes the map of its last run; the old state is kept beside `state` in the output folder
    #[arg(long)]
    fresh: bool,
    #[command(flatten)]
    options: RunOptions,
}

/// Runs a deployment to its end; the exit code.
pub(crate) fn run(args: &RunArgs, bars: &MultiProgress) -> anyhow::Result<u8> {
    let RunArgs { settings: path, fresh, options } = args;
    let mut settings = check::read(path)?;
    check::check_programs(&settings)?;
    drive::place_output(&mut settings, options)?;
    tracing::info!("deployment {}: Ctrl-C ends the run and writes the map", settings.name);
    // A simulation and a replay start from the beginning each time; a real robot is where its last run ended.
    let starts_over = settings.runs(BuiltIn::Simulator) || settings.runs(BuiltIn::Playback);
    let state = (!starts_over).then(|| settings.out.join("state"));
    let run = Options { state, fresh: *fresh, ..drive::once(options.speed.unwrap_or(1.0))? };
    Ok(drive::drive(&settings, &run, options.open, bars)?.exit_code)
}
