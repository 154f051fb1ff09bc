//! `stillmap evaluate`: how good results are, against the truth.

mod camera;

use crate::cli::EvaluateCommand;
use indicatif::MultiProgress;

/// Carries out an `evaluate` command; the exit code.
pub(crate) fn evaluate(command: &EvaluateCommand, bars: &MultiProgress) -> anyhow::Result<u8> {
    match command {
        EvaluateCommand::Camera(options) => camera::camera(options, bars),
    }
}
