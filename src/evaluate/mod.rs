//! `stillmap evaluate`: scores results against the truth.

mod camera;
mod chain;
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

/// The columns of the table, explained at the end of the long help.
const COLUMNS: &str = "\
Columns of the table, which has a row for each world and number of walkers:
  walkers     Number of walkers; `file` is the number in the world file.
  drives      Number of drives. Counts are summed over the drives of a row.
  ghosts      Ghost cells of the unfiltered map -> of the filtered map. A ghost cell is occupied,
              within 0.55 m of a walker's path, farther than 0.1 m from every surface, and not
              occupied in the map of the same drive without walkers.
  removed     Share of the ghost cells that the filter removed.
  walls lost  Share of the wall cells that are missing, of those that perfect verdicts would keep.
  vs empty    The same, of those in the map of the same drive without walkers.
  F1          Harmonic mean of precision and recall of the occupied cells against the surfaces.
  STD         Motion detection by sonar: precision and recall over the echoes of walkers, and
              false alarms per minute.
  track       Median distance of a walker within 3 m of the robot from the nearest track.

Without --world, RUN must be the log of a simulated deployment: the truth is read from it.";

#[derive(Debug, Args)]
#[command(args_conflicts_with_subcommands = true, after_long_help = COLUMNS)]
pub(crate) struct EvaluateArgs {
    #[command(subcommand)]
    pub(crate) command: Option<EvaluateCommand>,
    #[command(flatten)]
    pub(crate) drives: DriveArgs,
}

#[derive(Debug, Subcommand)]
pub(crate) enum EvaluateCommand {
    /// Runs background subtraction over a sequence of pictures and scores its masks against labelled truth
    Camera(CameraArgs),
}

/// Carries out an `evaluate` command.
pub(crate) fn evaluate(options: &EvaluateArgs, bars: &MultiProgress) -> anyhow::Result<()> {
    let drives = &options.drives;
    let report = match (&options.command, &drives.run) {
        (Some(EvaluateCommand::Camera(options)), _) => return camera::camera(options, bars),
        (None, Some(run)) => {
            let scored = recording::score(run)?;
            if let Some(folder) = &drives.out {
                let path = write_comparison(folder, &scored.trial)?;
                tracing::info!("wrote {}", path.display());
            }
            if !scored.with_reference {
                tracing::warn!(
                    "the world of the drive is not found: instead of the drive without walkers, the map of perfect verdicts is the reference"
                );
            }
            Report::of(vec![Row::new(run.display().to_string(), None, None, &scored.trial)])
        }
        (None, None) => sweep::sweep(drives, bars)?,
    };
    if drives.json {
        output::json(&serde_json::to_string_pretty(&report)?)?;
    } else {
        output::write(&report.to_string())?;
    }
    Ok(())
}

/// Scores the log of a drive that has ended and adds the walkers' paths to its comparison; the figures in a line.
pub(crate) fn score_run(folder: &Path, log: &Path) -> anyhow::Result<String> {
    let scored = recording::score(log)?;
    write_comparison(folder, &scored.trial)?;
    Ok(report::sentence(&scored.trial))
}
