//! What can be wrong with a log.

use std::io;
use std::path::{Path, PathBuf};

use messages::printable;

use crate::decode_error::DecodeError;

/// Bytes of a log that are not what they should be.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("damaged at byte {offset}: found {found}, expected {expected}{}", passed_over(*skipped))]
pub struct Damage {
    /// Where in the file, from 0.
    pub offset: u64,
    /// What stands there.
    pub found: String,
    /// What should.
    pub expected: String,
    /// Bytes from there on in which no record can be told from another; 0 when only that one is lost.
    pub skipped: u64,
}

fn passed_over(skipped: u64) -> String {
    if skipped > 0 { format!("; {skipped} bytes are passed over") } else { String::new() }
}

fn program(library: &str, profile: &str) -> String {
    let library = if library.is_empty() { "an unnamed program" } else { library };
    let profile = if profile.is_empty() { String::new() } else { format!(" with profile {profile}") };
    printable(&format!("{library}{profile}")).into_owned()
}

/// What reads a recording of this profile.
fn advice(profile: &str) -> &'static str {
    if profile == "ros2" { "; `stillmap log import --format ros2` makes one of it" } else { "" }
}

/// The reason that a file is not read as a log.
#[derive(Debug, thiserror::Error)]
pub enum Fault {
    /// The file cannot be opened, read or written.
    #[error("{0}")]
    Io(#[from] io::Error),
    /// Bytes that are not what they should be.
    #[error("{0}")]
    Damaged(#[from] Damage),
    /// The file ends before what every log starts with.
    #[error("cut at byte {offset}, expected the settings and the description of the run that a log starts with")]
    CutAtStart {
        /// Size of what can be read, bytes.
        offset: u64,
    },
    /// A sound MCAP file without the settings and the description of a run.
    #[error("recorded by {}: not a stillmap log{}", program(library, profile), advice(profile))]
    Foreign {
        /// The library that has written the file, as its header says.
        library: String,
        /// The profile of the messages, as its header says.
        profile: String,
    },
    /// A log of another format, or one whose description cannot be read.
    #[error("its description says {entry} {found:?}, expected {expected}")]
    Description {
        /// The entry of the description.
        entry: &'static str,
        /// What it says; empty when it is missing.
        found: String,
        /// What it should say.
        expected: &'static str,
    },
    /// A message that cannot be read, or whose numbers are invalid.
    #[error("message {sequence} of {topic}, in the chunk at byte {offset}: {source}")]
    Message {
        /// Where its chunk starts in the file, from 0.
        offset: u64,
        /// The service.
        topic: String,
        /// Its number, low 32 bits.
        sequence: u32,
        /// What is wrong with it.
        source: DecodeError,
    },
    /// A topic that was asked for and the log lacks.
    #[error("has no topic {topic:?}, its topics are {present}")]
    NoTopic {
        /// The topic.
        topic: String,
        /// What the log has.
        present: String,
    },
    /// A piece of another run than those before it.
    #[error("is of run {run:016x}, expected {expected:016x} as the first")]
    OtherRun {
        /// Its run.
        run: u64,
        /// The run of the first piece.
        expected: u64,
    },
    /// A line of a file that is imported.
    #[error("line {line}: found {found}, expected {expected}")]
    Line {
        /// Its number, from 1.
        line: usize,
        /// What stands there.
        found: String,
        /// What should.
        expected: String,
    },
    /// The log cannot be written.
    #[error("{0}")]
    Write(#[from] WriteError),
}

/// What is wrong with which file.
#[derive(Debug, thiserror::Error)]
#[error("{}: {fault}", path.display())]
pub struct LogError {
    /// The file.
    pub path: PathBuf,
    /// What is wrong with it.
    pub fault: Box<Fault>,
}

impl LogError {
    pub(crate) fn at<F: Into<Fault>>(path: &Path) -> impl FnOnce(F) -> Self {
        let path = path.to_owned();
        move |fault| Self { path, fault: Box::new(fault.into()) }
    }

    /// The error of a message that does not go into the log at `path`.
    pub fn writing(path: &Path) -> impl FnOnce(WriteError) -> Self {
        Self::at(path)
    }
}

/// A message that does not go into the log.
#[derive(Debug, thiserror::Error)]
#[error("the log cannot take the message: {0}")]
pub struct WriteError(#[from] mcap::McapError);
