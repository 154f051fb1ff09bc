//! What a child writes, cut into lines and read as tracing events.

use serde::Deserialize;
use tracing::Level;

/// Longest line that is kept whole; the rest of a longer one is dropped.
const LONGEST_LINE: usize = 8192;

/// Cuts a stream of bytes into lines; holds at most one line.
#[derive(Debug, Default)]
pub(crate) struct Lines {
    partial: Vec<u8>,
    too_long: bool,
}

impl Lines {
    /// Takes bytes and gives every line that they complete, without its end.
    pub(crate) fn push(&mut self, mut bytes: &[u8], mut each: impl FnMut(&str)) {
        while let Some(end) = bytes.iter().position(|b| *b == b'\n') {
            self.hold(&bytes[..end]);
            self.flush(&mut each);
            bytes = &bytes[end + 1..];
        }
        self.hold(bytes);
    }

    /// Gives what is left when the stream has ended.
    pub(crate) fn flush(&mut self, mut each: impl FnMut(&str)) {
        let text = String::from_utf8_lossy(&self.partial);
        let text = text.trim_end();
        if self.too_long {
            each(&format!("{text} …"));
        } else if !text.is_empty() {
            each(text);
        }
        self.partial.clear();
        self.too_long = false;
    }

    fn hold(&mut self, bytes: &[u8]) {
        let room = LONGEST_LINE - self.partial.len();
        self.partial.extend_from_slice(&bytes[..bytes.len().min(room)]);
        self.too_long |= bytes.len() > room;
    }
}

/// A line of a log.
#[derive(Debug, PartialEq, Eq)]
pub(crate) struct Line {
    pub(crate) level: Level,
    pub(crate) text: String,
}

/// One line of `tracing_subscriber`'s JSON format; what it also holds does not matter here.
#[derive(Deserialize)]
struct JsonEvent {
    level: String,
    fields: serde_json::Map<String, serde_json::Value>,
}

impl Line {
    /// Reads what a child wrote: an event in JSON, or else words that are worth a warning, such as those of a panic.
    pub(crate) fn read(line: &str) -> Self {
        let event = line.starts_with('{').then(|| serde_json::from_str::<JsonEvent>(line).ok()).flatten();
        match event.and_then(|event| Some((event.level.parse().ok()?, event.fields))) {
            Some((level, fields)) => Self { level, text: words(&fields) },
            None => Self { level: Level::WARN, text: line.to_owned() },
        }
    }
}

/// The message, then the other fields as `key=value`.
fn words(fields: &serde_json::Map<String, serde_json::Value>) -> String {
    let plain = |value: &serde_json::Value| value.as_str().map_or_else(|| value.to_string(), str::to_owned);
    let message = fields.get("message").map(plain);
    let others = fields.iter().filter(|(key, _)| *key != "message").map(|(key, value)| format!("{key}={}", plain(value)));
    message.into_iter().chain(others).collect::<Vec<_>>().join(" ")
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn lines(chunks: &[&[u8]]) -> Vec<String> {
        let (mut lines, mut found) = (Lines::default(), vec![]);
        for chunk in chunks {
            lines.push(chunk, |line| found.push(line.to_owned()));
        }
        lines.flush(|line| found.push(line.to_owned()));
        found
    }

    #[test]
    fn lines_come_whole_and_without_their_ends() {
        assert_eq!(lines(&[b"one\r\ntw", b"o\n\nthree"]), ["one", "two", "three"]);
        assert_eq!(lines(&[b"\xff\n"]), ["\u{fffd}"]);
    }

    #[test]
    fn a_line_that_never_ends_is_cut_and_the_next_is_whole() {
        let flood = vec![b'x'; 3 * LONGEST_LINE];
        let found = lines(&[&flood, b"tail\nnext\n"]);
        assert_eq!(found.len(), 2);
        assert_eq!(found[0], format!("{} …", "x".repeat(LONGEST_LINE)));
        assert_eq!(found[1], "next");
    }

    #[test]
    fn a_json_event_keeps_its_level_and_fields() {
        let line = r#"{"timestamp":"2026-01-01T00:00:00Z","level":"INFO","fields":{"message":"found the robot","baud":9600,"port":"/dev/x"},"target":"pioneer"}"#;
        let expected = Line { level: Level::INFO, text: "found the robot baud=9600 port=/dev/x".to_owned() };
        assert_eq!(Line::read(line), expected);
    }

    #[test]
    fn anything_else_is_a_warning_in_its_own_words() {
        for line in ["thread 'main' panicked", "{", r#"{"level":"LOUD","fields":{}}"#, r#"{"level":1}"#, "[]"] {
            assert_eq!(Line::read(line), Line { level: Level::WARN, text: line.to_owned() });
        }
    }

    proptest! {
        #[test]
        fn how_the_stream_is_cut_does_not_matter(bytes in prop::collection::vec(prop_oneof![Just(b'\n'), any::<u8>()], 0..200), at in 0usize..200) {
            let at = at.min(bytes.len());
            prop_assert_eq!(lines(&[&bytes]), lines(&[&bytes[..at], &bytes[at..]]));
        }
    }
}
