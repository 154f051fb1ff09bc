//! `stillmap evaluate`: how good results are, against the truth.

mod camera;
mod comparison;
mod recording;
mod report;
mod sweep;

use crate::output;
use camera::CameraArgs;
use clap::{Args, Subcommand};
use comparison::write_comparison;
use indicatif::MultiProgress;
use report::{Report, Row};
use std::path::Path;
use sweep::DriveArgs;

#[derive(Debug, Args)]
#[command(args_conflicts_with_subcommands = true)]
pub(crate) struct EvaluateArgs {
    #[command(subcommand)]
    pub(crate) command: Option<EvaluateCommand>,
    #[command(flatten)]
    pub(crate) drives: DriveArgs,
}

#[derive(Debug, Subcommand)]
pub(crate) enum EvaluateCommand {
    /// Scores what moves in a camera's pictures: finds it and compares it with the truth, pixel by pixel
    Camera(CameraArgs),
}

/// Carries out an `evaluate` command.
pub(crate) fn evaluate(options: &EvaluateArgs, bars: &MultiProgress) -> anyhow::Result<()> {
    let drives = &options.drives;
    let report = match (&options.command, &drives.run) {
        (Some(EvaluateCommand::Camera(options)), _) => return camera::camera(options, bars),
        (None, Some(run)) => {
            let judged = recording::judge(run)?;
            if let Some(folder) = &drives.out {
                let path = write_comparison(folder, &judged.trial)?;
                tracing::info!("wrote {}", path.display());
            }
            if !judged.with_reference {
                tracing::warn!("the world of the drive is not at hand: what needs the drive without walkers is judged by the true labels");
            }
            Report::of(vec![Row::new(run.display().to_string(), None, None, &judged.trial)])
        }
        (None, None) => sweep::sweep(drives, bars)?,
    };
    if drives.json {
        output::line(&serde_json::to_string_pretty(&report)?)?;
    } else {
        output::write(&report.to_string())?;
    }
    Ok(())
}

/// Judges the log of a drive that has just ended, puts the walkers' ways into its comparison, and says the figures in a line.
pub(crate) fn conclude(folder: &Path, log: &Path) -> anyhow::Result<String> {
    let judged = recording::judge(log)?;
    write_comparison(folder, &judged.trial)?;
    Ok(report::sentence(&judged.trial))
}
