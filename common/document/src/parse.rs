//! Files and texts into types, with errors that say where.

use core::ops::Range;
use std::io::Read as _;
use std::path::Path;

use serde::de::DeserializeOwned;
use toml::Spanned;
use toml::de::{DeTable, DeValue};

use crate::error::{one_line, shortened};
use crate::located::{Kind, Located, LocatedError};
use crate::{DocumentError, Fault};

/// Longest file that is read, in bytes: the shipped deployments have at most 5,200.
pub const MAX_BYTES: usize = 1 << 20;

/// The text of a file.
///
/// # Errors
/// When the file cannot be read, is longer than [`MAX_BYTES`] or is not UTF-8.
pub fn read_text(path: &Path) -> Result<String, DocumentError> {
    let file = || one_line(&path.display().to_string());
    let mut bytes = Vec::new();
    std::fs::File::open(path)
        .and_then(|file| file.take(MAX_BYTES as u64 + 1).read_to_end(&mut bytes))
        .map_err(|source| DocumentError::unreadable(path, source))?;
    if bytes.len() > MAX_BYTES {
        return Err(DocumentError::TooLong { file: file(), limit: MAX_BYTES });
    }
    decode(&file(), bytes)
}

/// UTF-8 bytes as text.
fn decode(file: &str, bytes: Vec<u8>) -> Result<String, DocumentError> {
    String::from_utf8(bytes).map_err(|error| {
        let offset = error.utf8_error().valid_up_to();
        let before = &error.as_bytes()[..offset];
        let byte = error.as_bytes().get(offset).copied().unwrap_or_default();
        let line = 1 + before.iter().filter(|byte| **byte == b'\n').count();
        DocumentError::NotText { file: file.to_owned(), line, offset, byte }
    })
}

/// Reads a value from TOML text; `file` is what errors call the text.
///
/// # Errors
/// The first problem of the text, with file, line, key, value and what was expected.
pub fn parse<T: DeserializeOwned>(file: &str, text: &str) -> Result<T, DocumentError> {
    parse_checked(file, text, |_| Ok(()))
}

/// Reads a value from TOML text and holds it against `check`, whose fault is then told with the line and value of its key.
///
/// # Errors
/// As [`parse`]; and the fault that `check` finds.
pub fn parse_checked<T: DeserializeOwned>(file: &str, text: &str, check: impl FnOnce(&T) -> Result<(), Fault>) -> Result<T, DocumentError> {
    let source = Source { file: one_line(file), text };
    if text.len() > MAX_BYTES {
        return Err(DocumentError::TooLong { file: source.file, limit: MAX_BYTES });
    }
    let table = DeTable::parse(text).map_err(|error| source.syntax(&error))?;
    let span = table.span();
    let document = Spanned::new(span, DeValue::Table(table.into_inner()));
    let value = T::deserialize(Located(&document)).map_err(|error| source.error(error))?;
    check(&value).map_err(|fault| source.fault(&document, fault))?;
    Ok(value)
}

/// A text under the name that errors call it by.
struct Source<'t> {
    file: String,
    text: &'t str,
}

impl Source<'_> {
    fn syntax(&self, error: &toml::de::Error) -> DocumentError {
        let span = error.span().unwrap_or(self.text.len()..self.text.len());
        let (line, column) = self.place(span.start);
        // An empty span points at the character that should not be there.
        let found = match self.piece(span.start..span.end.max(span.start + 1)) {
            "" => "the end of the file".to_owned(),
            piece if piece.trim().is_empty() => "the end of the line".to_owned(),
            piece => format!("`{}`", shortened(piece)),
        };
        DocumentError::Syntax { file: self.file.clone(), line, column, found, problem: one_line(error.message()) }
    }

    fn error(&self, error: LocatedError) -> DocumentError {
        let key = error.key();
        let span = error.span.clone().unwrap_or(0..0);
        let (line, _) = self.place(span.start);
        match error.kind {
            Kind::UnknownKey { known } => {
                DocumentError::UnknownKey { file: self.file.clone(), line, known: nearest_first(&key, known), key }
            }
            Kind::MissingKey => DocumentError::MissingKey { file: self.file.clone(), line, key },
            Kind::Value(problem) => {
                let found = (!error.in_table).then(|| shortened(self.piece(span)));
                DocumentError::Value { file: self.file.clone(), line, key, found, problem: one_line(&problem) }
            }
        }
    }

    fn fault(&self, document: &Spanned<DeValue<'_>>, fault: Fault) -> DocumentError {
        let (value, written) = deepest(document, &fault.key);
        let (line, _) = self.place(value.span().start);
        let found = (written && !is_table_like(value.get_ref())).then(|| shortened(self.piece(value.span())));
        DocumentError::Value {
            file: self.file.clone(),
            line,
            key: fault.key,
            found,
            problem: one_line(&format!("expected {}", fault.expected)),
        }
    }

    /// Line and character of a byte offset, both from 1.
    fn place(&self, offset: usize) -> (usize, usize) {
        let before = self.text.get(..offset).unwrap_or(self.text);
        let line_start = before.rfind('\n').map_or(0, |newline| newline + 1);
        (1 + before.matches('\n').count(), 1 + before[line_start..].chars().count())
    }

    /// The text of a span; a character that the span cuts counts to what is before it.
    fn piece(&self, span: Range<usize>) -> &str {
        let boundary =
            |offset: usize| (offset..self.text.len()).find(|offset| self.text.is_char_boundary(*offset)).unwrap_or(self.text.len());
        self.text.get(boundary(span.start)..boundary(span.end)).unwrap_or_default()
    }
}

/// The value at a path such as `process[0].name`, or, when the document leaves it out, the deepest value on the way and `false`.
fn deepest<'t, 'd>(document: &'t Spanned<DeValue<'d>>, key: &str) -> (&'t Spanned<DeValue<'d>>, bool) {
    let mut value = document;
    for segment in key.split(['.', '[']) {
        let next = match segment.strip_suffix(']') {
            Some(index) => index.parse::<usize>().ok().and_then(|index| value.get_ref().get(index)),
            None => value.get_ref().get(segment),
        };
        match next {
            Some(next) => value = next,
            None => return (value, false),
        }
    }
    (value, true)
}

/// A table, or a list of tables: text that says nothing in one line.
fn is_table_like(value: &DeValue<'_>) -> bool {
    match value {
        DeValue::Table(_) => true,
        DeValue::Array(list) => list.iter().any(|entry| entry.get_ref().is_table()),
        _ => false,
    }
}

/// The known keys as words, those most like the last part of `key` first.
fn nearest_first(key: &str, known: &[&str]) -> String {
    let wrong = key.rsplit('.').next().unwrap_or(key);
    let mut known: Vec<&str> = known.to_vec();
    known.sort_by_key(|right| distance(wrong, right));
    match known.as_slice() {
        [] => "no key".to_owned(),
        [only] => (*only).to_owned(),
        _ => format!("one of {}", known.join(", ")),
    }
}

/// Edit distance (Levenshtein) in bytes.
fn distance(a: &str, b: &str) -> usize {
    let mut row: Vec<usize> = (0..=b.len()).collect();
    for (i, from) in a.bytes().enumerate() {
        let mut diagonal = i;
        let mut left = i + 1;
        for (cell, to) in row.iter_mut().skip(1).zip(b.bytes()) {
            let above = *cell;
            left = (diagonal + usize::from(from != to)).min(left + 1).min(above + 1);
            diagonal = above;
            *cell = left;
        }
        if let Some(first) = row.first_mut() {
            *first = i + 1;
        }
    }
    row.last().copied().unwrap_or_default()
}
