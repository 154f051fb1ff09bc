//! One complete log from what can be read of a cut or damaged one.

use std::fs::{self, File};
use std::io::Write;
use std::path::Path;

use crate::damage::{Fault, LogError};
use crate::gaps::Gaps;
use crate::log::Log;
use crate::message_reader::RawMessage;
use crate::writer::{LogWriter, Times};

/// The result of a recovery.
#[derive(Debug, Default)]
pub struct Recovered {
    /// Messages in the new log.
    pub messages: u64,
    /// Size of the new log.
    pub bytes: u64,
    /// What could not be read.
    pub damages: Vec<LogError>,
    /// What is missing in both logs.
    pub gaps: Gaps,
}

/// Writes everything that can be read of the log `from`, with the parts that follow it, into the new file `to`, in order and
/// with its index.
///
/// # Errors
/// When `from` is no log, or `to` exists already or cannot be written; an unfinished file is removed.
pub fn recover(from: &Path, to: &Path) -> Result<Recovered, LogError> {
    let mut log = Log::open(from)?;
    let mut file = File::create_new(to).map_err(LogError::at(to))?;
    copy(&mut log, &mut file, &mut |_| true).map_err(|fault| {
        // The first failure is the one to tell.
        let _ = fs::remove_file(to);
        LogError::at(to)(fault)
    })
}

/// Copies the messages of a log that `is_chosen` accepts.
pub(crate) fn copy(log: &mut Log, file: &mut File, is_chosen: &mut dyn FnMut(&RawMessage<'_>) -> bool) -> Result<Recovered, Fault> {
    let mut writer = LogWriter::new(log.preamble(), 1, 0)?;
    let mut recovered = Recovered::default();
    loop {
        match log.advance() {
            Ok(true) => {
                let Some(message) = log.message().filter(|message| is_chosen(message)) else { continue };
                let format = || message.channel.format.clone();
                let times = Times { log_ns: message.log_ns, stamp_ns: message.stamp_ns };
                writer.raw(&message.channel.topic, format, times, message.sequence, message.data)?;
                recovered.messages += 1;
                recovered.bytes += append(file, &writer.take())?;
            }
            Ok(false) => break,
            Err(error) => recovered.damages.push(error),
        }
    }
    recovered.gaps = log.gaps();
    recovered.bytes += append(file, &writer.finish()?)?;
    Ok(recovered)
}

pub(crate) fn append(file: &mut File, bytes: &[u8]) -> Result<u64, Fault> {
    file.write_all(bytes)?;
    Ok(bytes.len() as u64)
}
