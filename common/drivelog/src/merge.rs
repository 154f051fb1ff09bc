//! One log from several pieces of a run.

use std::fs::{self, File};
use std::path::{Path, PathBuf};

use crate::damage::{Fault, LogError};
use crate::log::{Log, is_sequenced};
use crate::numbers::Numbers;
use crate::recover::{Recovered, append};
use crate::writer::{LogWriter, Times};

/// A piece with the message that comes next.
struct Piece {
    log: Log,
    at_end: bool,
}

/// Writes the messages of the logs `from`, which are of one run, into the new file `to` in the order of their times. A numbered message
/// that several have is written once.
///
/// # Errors
/// When one of them is no log or of another run than the first, or `to` exists already or cannot be written; an unfinished file is
/// removed.
pub fn merge(from: &[PathBuf], to: &Path) -> Result<Recovered, LogError> {
    let mut pieces = Vec::new();
    for path in from {
        pieces.push(Piece { log: Log::open(path)?, at_end: false });
        let runs = [0, pieces.len() - 1].map(|piece| pieces[piece].log.preamble().run);
        if runs[0] != runs[1] {
            return Err(LogError::at(path)(Fault::OtherRun { run: runs[1], expected: runs[0] }));
        }
    }
    let mut file = File::create_new(to).map_err(LogError::at(to))?;
    write(&mut pieces, &mut file).map_err(|fault| {
        // The first failure is the one to tell.
        let _ = fs::remove_file(to);
        LogError::at(to)(fault)
    })
}

fn write(pieces: &mut [Piece], file: &mut File) -> Result<Recovered, Fault> {
    let mut merged = Recovered::default();
    let Some(first) = pieces.first() else { return Ok(merged) };
    let mut writer = LogWriter::new(first.log.preamble(), 1, 0)?;
    let mut numbers = Numbers::default();
    pieces.iter_mut().for_each(|piece| piece.advance(&mut merged));
    loop {
        let times = pieces.iter().enumerate().filter_map(|(number, piece)| Some((piece.message_ns()?, number)));
        let Some((_, next)) = times.min() else { break };
        let Some(piece) = pieces.get_mut(next) else { break };
        if let Some(message) = piece.log.message() {
            let topic = message.channel.topic.as_str();
            // Pieces may begin anywhere in the run.
            if !is_sequenced(topic) || numbers.take(topic, message.sequence, true) {
                let times = Times { log_ns: message.log_ns, stamp_ns: message.stamp_ns };
                writer.raw(topic, || message.channel.format.clone(), times, message.sequence, message.data)?;
                merged.messages += 1;
                merged.bytes += append(file, &writer.take())?;
            }
        }
        piece.advance(&mut merged);
    }
    merged.gaps.messages = numbers.into_missing();
    merged.bytes += append(file, &writer.finish()?)?;
    Ok(merged)
}

impl Piece {
    /// Advances to the next message that can be read.
    fn advance(&mut self, merged: &mut Recovered) {
        loop {
            match self.log.advance() {
                Ok(has_message) => {
                    self.at_end = !has_message;
                    return;
                }
                Err(error) => merged.damages.push(error),
            }
        }
    }

    /// The time of its next message; `None` at its end.
    fn message_ns(&self) -> Option<u64> {
        self.log.message().filter(|_| !self.at_end).map(|message| message.log_ns)
    }
}
