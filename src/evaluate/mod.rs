//! `stillmap evaluate`: scores results against the truth.

mod camera;
mod chain;
mod comparison;
mod localisation;
mod recording;
mod report;
mod sweep;
mod table;

use crate::drive::lock_folder;
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
  walkers   Number of walkers; `file` is the number in the world file.
  drives    Number of drives. Counts are summed over the drives of a row.
  ghosts    Cells that walkers caused, without -> with the filter: they are occupied without the
            filter, but not with true labels of all echoes.
  removed   Share of these that the filter removed.
  lost      Share of the occupied cells of the true-label map that the filter lost.
  worst     The same of the worst drive, with its seed.
  net       Change of the number of cells that differ from the true-label map: -100 % is the
            true-label map; above 0 the map is better without the filter.
  IoU       Intersection over union of the occupied cells with those of the map of the same drive
            without walkers, with a tolerance of one cell, without -> with the filter.
  blocked   Share of the places that a robot of 0.25 m reaches in the empty building and not in
            the map, without -> with the filter.
  F1        Harmonic mean of precision and recall of the occupied cells against the surfaces.
  SA/DA/AA  Static accuracy: share of the echoes of still things that enter the map. Dynamic
            accuracy: share of the echoes of walkers that do not. Associated accuracy: the
            geometric mean of both.
  STD       Motion detection by sonar: precision and recall over the echoes of walkers, and
            false alarms per minute.

Columns of the second table, which --odometry adds; means over the drives of a row:
  path      Length of the true path.
  F1        Of the map by true poses, by odometry alone, by localisation's poses as scans enter
            the map, and by its final poses, with the final F1 of the worst drive. Verdicts are
            the same.
  ATE       Absolute trajectory error: root mean square distance of the poses from the true ones
            after a rigid alignment, by odometry, at commit, at the end, and of the worst drive.
  closures  Places recognised.

Without --world and --random, RUN is the log of a simulated deployment: the truth is read from it.";

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
    let _locked = drives.out.as_deref().map(lock_folder).transpose()?;
    let report = match (&options.command, &drives.run) {
        (Some(EvaluateCommand::Camera(options)), _) => return camera::camera(options, bars),
        (None, Some(run)) => {
            let scored = recording::score(run, drives.replay)?;
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
    let _locked = lock_folder(folder)?;
    let scored = recording::score(log, false)?;
    write_comparison(folder, &scored.trial)?;
    Ok(report::sentence(&scored.trial))
}
