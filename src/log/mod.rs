//! `stillmap log`: describes, cuts, recovers, imports and exports logs.

mod bag;

use crate::args::seconds;
use crate::exit::BadInput;
use crate::{exit, output};
use clap::{Subcommand, ValueEnum};
use drivelog::{Recovered, Selection, Span, Table};
use std::path::{Path, PathBuf};
use std::time::Duration;

#[derive(Debug, Subcommand)]
pub(crate) enum LogCommand {
    /// Prints what a log contains and what is damaged in it
    Info {
        /// The log
        #[arg(value_name = "FILE")]
        log: PathBuf,
        /// Print it as JSON
        #[arg(long)]
        json: bool,
    },
    /// Copies a span of time of a log into a new log
    Cut {
        /// The log
        #[arg(value_name = "FILE")]
        log: PathBuf,
        /// Start of the span, in seconds from the start of the log
        #[arg(long, value_name = "S", value_parser = seconds, default_value = "0")]
        from: Duration,
        /// End of the span, in seconds from the start of the log. The default is the end of the log
        #[arg(long, value_name = "S", value_parser = seconds)]
        to: Option<Duration>,
        /// The new log
        #[arg(long, value_name = "LOG")]
        out: PathBuf,
    },
    /// Copies some topics of a log into a new log
    Filter {
        /// The log
        #[arg(value_name = "FILE")]
        log: PathBuf,
        /// The topics, separated by commas. A replay needs robot/scan, and camera/frame for the camera
        #[arg(long, value_name = "TOPICS", value_delimiter = ',', required = true)]
        topics: Vec<String>,
        /// The new log
        #[arg(long, value_name = "LOG")]
        out: PathBuf,
    },
    /// Writes the messages of several logs of one run, such as pieces that were cut, into one log in the order of their times
    Merge {
        /// The logs
        #[arg(value_name = "FILE", required = true)]
        logs: Vec<PathBuf>,
        /// The new log
        #[arg(long, value_name = "LOG")]
        out: PathBuf,
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
        /// The recording: for robond its folder, for ros2 the folder or the file of a bag
        #[arg(value_name = "PATH")]
        from: PathBuf,
        /// The log to write
        #[arg(long, value_name = "LOG")]
        out: PathBuf,
        /// ros2: the topics to import, separated by commas; sonars are numbered in their order. The default is every topic that can be
        /// imported
        #[arg(long, value_name = "TOPICS", value_delimiter = ',')]
        topics: Vec<String>,
        /// ros2: settings for the replay of the log. Mounts that the bag lacks are taken from them
        #[arg(long, value_name = "FILE")]
        settings: Option<PathBuf>,
    },
    /// Converts a log into a recording of other software
    Export {
        /// Format of the recording
        #[arg(long, value_enum)]
        format: ExportFormat,
        /// The log
        #[arg(value_name = "FILE")]
        log: PathBuf,
        /// The folder to write; it must not exist
        #[arg(long, value_name = "DIR")]
        out: PathBuf,
    },
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum ExportFormat {
    /// Tables: one for each topic of numbers, and one for each list in its messages
    Csv,
    /// A bag of ROS 2 in MCAP: map, transforms, odometry, ranges, pictures, walkers
    Ros2,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum ImportFormat {
    /// The occupancy grid exercise of RoboND: measurement.txt and poses.txt
    Robond,
    /// A bag of ROS 2, in MCAP or SQLite: sensor_msgs/Range, nav_msgs/Odometry or /tf, /tf_static, sensor_msgs/Image or CompressedImage,
    /// CameraInfo
    Ros2,
}

/// Carries out a `log` command; the exit code.
pub(crate) fn log(command: &LogCommand) -> anyhow::Result<u8> {
    match command {
        LogCommand::Info { log, json } => {
            let info = drivelog::info(log)?;
            if *json {
                output::json(&format!("{:#}", info.to_json()))?;
            } else {
                output::write(&info.to_string())?;
            }
            if !info.is_complete() {
                return Ok(exit::INCOMPLETE);
            }
        }
        LogCommand::Cut { log, from, to, out } => {
            let to_ns = to.map(nanoseconds);
            report(
                out,
                &drivelog::select(log, &Selection { span: Span { from_ns: nanoseconds(*from), to_ns }, topics: Vec::new() }, out)?,
            )?;
        }
        LogCommand::Filter { log, topics, out } => {
            report(out, &drivelog::select(log, &Selection { topics: topics.clone(), ..Selection::default() }, out)?)?;
        }
        LogCommand::Merge { logs, out } => report(out, &drivelog::merge(logs, out)?)?,
        LogCommand::Recover { log, out } => recover(log, out.clone().unwrap_or_else(|| recovered_name(log)))?,
        LogCommand::Import { format: ImportFormat::Ros2, from, out, topics, settings } => {
            bag::import(from, topics, settings.as_deref(), out)?
        }
        LogCommand::Export { format: ExportFormat::Ros2, log, out } => bag::export(log, out)?,
        LogCommand::Export { format: ExportFormat::Csv, log, out } => export_csv(log, out)?,
        LogCommand::Import { format: ImportFormat::Robond, from, out, topics, settings } => {
            if !topics.is_empty() || settings.is_some() {
                return Err(BadInput("--topics and --settings are options of --format ros2".to_owned()).into());
            }
            let imported = drivelog::import_robond(from, out)?;
            output::line(&format!("{}: {} scans", out.display(), imported.scans))?;
        }
    }
    Ok(exit::SUCCESS)
}

fn recover(log: &Path, out: PathBuf) -> anyhow::Result<()> {
    report(&out, &drivelog::recover(log, &out)?)
}

/// Prints what came of a copy.
fn report(out: &Path, copied: &Recovered) -> anyhow::Result<()> {
    for damage in &copied.damages {
        output::line(&format!("damage    {damage}"))?;
    }
    for gap in copied.gaps.lines() {
        output::line(&format!("missing   {gap}"))?;
    }
    Ok(output::line(&format!("{}: {} messages, {} bytes", out.display(), copied.messages, copied.bytes))?)
}

/// Writes the tables of a log and prints their sizes.
fn export_csv(log: &Path, out: &Path) -> anyhow::Result<()> {
    let tables = drivelog::export_csv(log, out)?;
    for damage in &tables.damages {
        output::line(&format!("damage    {damage}"))?;
    }
    for Table { path, topic, rows } in &tables.tables {
        output::line(&format!("{}: {rows} rows of {}", path.display(), messages::printable(topic)))?;
    }
    Ok(())
}

fn nanoseconds(span: Duration) -> u64 {
    u64::try_from(span.as_nanos()).unwrap_or(u64::MAX)
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
