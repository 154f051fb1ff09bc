//! `stillmap log`: describes, recovers and imports logs.

use crate::{exit, output};
use clap::{Subcommand, ValueEnum};
use std::path::{Path, PathBuf};

#[derive(Debug, Subcommand)]
pub(crate) enum LogCommand {
    /// Prints what a log contains and what is damaged in it
    Info {
        /// The log
        #[arg(value_name = "FILE")]
        log: PathBuf,
    },
    /// Writes the readable part of a damaged log into a new log
    Recover {
        /// The damaged log
        #[arg(value_name = "FILE")]
        log: PathBuf,
        /// The new log. The default is FILE with `-recovered` before its extension
        #[arg(long, value_name = "LOG")]
        out: Option<PathBuf>,
    },
    /// Converts a recording of other software into a log
    Import {
        /// Format of the recording
        #[arg(long, value_enum)]
        format: ImportFormat,
        /// Folder of the recording
        #[arg(value_name = "DIR")]
        from: PathBuf,
        /// The log to write
        #[arg(long, value_name = "LOG")]
        out: PathBuf,
    },
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum ImportFormat {
    /// The occupancy grid exercise of RoboND: measurement.txt and poses.txt
    Robond,
}

/// Carries out a `log` command; the exit code.
pub(crate) fn log(command: &LogCommand) -> anyhow::Result<u8> {
    match command {
        LogCommand::Info { log } => {
            let info = drivelog::info(log)?;
            output::write(&info.to_string())?;
            if !info.is_complete() {
                return Ok(exit::INCOMPLETE);
            }
        }
        LogCommand::Recover { log, out } => recover(log, out.clone().unwrap_or_else(|| recovered_name(log)))?,
        LogCommand::Import { format: ImportFormat::Robond, from, out } => {
            let imported = drivelog::import_robond(from, out)?;
            output::line(&format!("{}: {} scans", out.display(), imported.scans))?;
        }
    }
    Ok(exit::SUCCESS)
}

fn recover(log: &Path, out: PathBuf) -> anyhow::Result<()> {
    let recovered = drivelog::recover(log, &out)?;
    for damage in &recovered.damages {
        output::line(&format!("damage    {damage}"))?;
    }
    for gap in recovered.gaps.lines() {
        output::line(&format!("missing   {gap}"))?;
    }
    Ok(output::line(&format!("{}: {} messages, {} bytes", out.display(), recovered.messages, recovered.bytes))?)
}

/// The default path of a recovered log, beside the damaged one.
fn recovered_name(log: &Path) -> PathBuf {
    let stem = log.file_stem().unwrap_or_default().to_string_lossy();
    log.with_file_name(format!("{stem}-recovered.mcap"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_recovered_log_is_written_beside_the_damaged_one() {
        assert_eq!(recovered_name(Path::new("logs/drive.mcap")), Path::new("logs/drive-recovered.mcap"));
    }
}
