//! Why a file is refused, in one line.

use std::path::Path;

/// Why a file was refused. `Display` is one line that says where, what was found and what was expected.
#[derive(Debug, thiserror::Error)]
pub enum DocumentError {
    /// The file cannot be opened or read.
    #[error("{file}: cannot be read: {source}")]
    Unreadable {
        /// The file.
        file: String,
        /// Why.
        source: std::io::Error,
    },
    /// The file is longer than any settings.
    #[error("{file}: more than {limit} bytes, expected settings")]
    TooLong {
        /// The file.
        file: String,
        /// Greatest length accepted.
        limit: usize,
    },
    /// The file is not UTF-8.
    #[error("{file}:{line}: found byte 0x{byte:02x} at offset {offset}, expected UTF-8 text")]
    NotText {
        /// The file.
        file: String,
        /// Line, from 1.
        line: usize,
        /// Offset of the first byte that is no text.
        offset: usize,
        /// That byte.
        byte: u8,
    },
    /// The text is not TOML.
    #[error("{file}:{line}:{column}: found {found}: {problem}")]
    Syntax {
        /// The file.
        file: String,
        /// Line, from 1.
        line: usize,
        /// Character in the line, from 1.
        column: usize,
        /// What stands there.
        found: String,
        /// What is wrong with it and what was expected.
        problem: String,
    },
    /// A value that its key does not take.
    #[error("{file}:{line}: {key}{}: {problem}", equals(found))]
    Value {
        /// The file.
        file: String,
        /// Line, from 1.
        line: usize,
        /// Path of the key, for example `process[0].name`.
        key: String,
        /// The value as it stands in the file, shortened; nothing for tables and for values that the file leaves out.
        found: Option<String>,
        /// What was expected.
        problem: String,
    },
    /// A key that does not exist.
    #[error("{file}:{line}: {key}: unknown key, expected {known}")]
    UnknownKey {
        /// The file.
        file: String,
        /// Line, from 1.
        line: usize,
        /// Path of the key.
        key: String,
        /// The keys that exist there, nearest first.
        known: String,
    },
    /// A key without which a table means nothing.
    #[error("{file}:{line}: {key}: missing, expected this key")]
    MissingKey {
        /// The file.
        file: String,
        /// Line of the table, from 1.
        line: usize,
        /// Path of the key.
        key: String,
    },
    /// A path that TOML cannot hold.
    #[error("{key}: expected a path in UTF-8, for it is written to a file")]
    Unwritable {
        /// Path of the key.
        key: String,
    },
}

impl DocumentError {
    /// `path` cannot be opened, read or resolved.
    #[must_use]
    pub fn unreadable(path: &Path, source: std::io::Error) -> Self {
        Self::Unreadable { file: one_line(&path.display().to_string()), source }
    }
}

/// A value that does not go with the rest of the document.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{key}: expected {expected}")]
pub struct Fault {
    /// Path of the key, for example `process[0].name`.
    pub key: String,
    /// What was expected.
    pub expected: String,
}

impl Fault {
    /// A fault at `key`.
    #[must_use]
    pub fn new(key: impl Into<String>, expected: impl Into<String>) -> Self {
        Self { key: key.into(), expected: expected.into() }
    }
}

/// ` = value`, when there is one.
fn equals(found: &Option<String>) -> String {
    found.as_ref().map_or_else(String::new, |found| format!(" = {found}"))
}

/// A piece of a file as one short line.
pub(crate) fn shortened(text: &str) -> String {
    const MOST: usize = 60;
    let text = text.trim();
    match text.char_indices().nth(MOST) {
        Some((end, _)) => format!("{}…", one_line(&text[..end])),
        None => one_line(text),
    }
}

/// A text as one line in which nothing moves the cursor of a terminal.
pub(crate) fn one_line(text: &str) -> String {
    let mut line = String::with_capacity(text.len());
    for character in text.chars() {
        match character {
            '"' | '\'' | '\\' => line.push(character),
            _ => line.extend(character.escape_debug()),
        }
    }
    line
}
