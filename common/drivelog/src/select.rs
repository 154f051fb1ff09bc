//! A part of a log: a span of its time, or some of its topics.

use std::collections::BTreeSet;
use std::fs::{self, File};
use std::path::Path;

use crate::damage::{Fault, LogError};
use crate::log::Log;
use crate::message_reader::RawMessage;
use crate::recover::{Recovered, copy};
use crate::span::{Span, Timing};

/// What of a log is copied.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Selection {
    /// Its time.
    pub span: Span,
    /// The topics; of an empty list all.
    pub topics: Vec<String>,
}

/// Copies a selection of the log `from`, with the parts that follow it, into the new file `to`, as [`recover`](fn@crate::recover) does.
///
/// # Errors
/// As [`recover`](fn@crate::recover), and when the log has no message of a named topic.
pub fn select(from: &Path, selection: &Selection, to: &Path) -> Result<Recovered, LogError> {
    let mut log = Log::open(from)?;
    let mut file = File::create_new(to).map_err(LogError::at(to))?;
    let (mut first_ns, mut topics) = (None, BTreeSet::new());
    let copied = copy(&mut log, &mut file, &mut |message: &RawMessage<'_>| {
        let topic = message.channel.topic.as_str();
        if !topics.contains(topic) {
            topics.insert(topic.to_owned());
        }
        let timing = selection.span.timing(*first_ns.get_or_insert(message.log_ns), message.log_ns);
        let is_chosen = selection.topics.is_empty() || selection.topics.iter().any(|chosen| chosen == topic);
        is_chosen && timing == Timing::Within
    });
    let checked = copied.and_then(|recovered| match selection.topics.iter().find(|topic| !topics.contains(*topic)) {
        Some(topic) => {
            Err(Fault::NoTopic { topic: topic.clone(), present: topics.iter().map(String::as_str).collect::<Vec<_>>().join(", ") })
        }
        None => Ok(recovered),
    });
    checked.map_err(|fault| {
        // The first failure is the one to tell.
        let _ = fs::remove_file(to);
        let path = if matches!(fault, Fault::NoTopic { .. }) { from } else { to };
        LogError::at(path)(fault)
    })
}
