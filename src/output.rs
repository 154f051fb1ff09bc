//! Results on standard output.

use crate::terminal;
use messages::printable;
use std::io::{self, Write};

/// Writes a line of results. Characters that would act on a terminal are escaped. A closed pipe, as
/// after `head`, is no error.
pub(crate) fn line(text: &str) -> io::Result<()> {
    write_as_is(&format!("{}\n", printable(text)))
}

/// Writes lines of results, as [`line()`]. Line breaks are kept: text from outside has to be escaped before it is put in.
pub(crate) fn write(text: &str) -> io::Result<()> {
    let lines: String = text.split_inclusive('\n').map(escaped).collect();
    write_as_is(&lines)
}

/// Writes JSON and a line break. serde escapes the control characters below U+0020 only; the others may be escaped as well.
pub(crate) fn json(text: &str) -> io::Result<()> {
    let is_plain = |c: char| c == '\n' || printable(c.encode_utf8(&mut [0; 4])).len() == c.len_utf8();
    let mut safe = String::with_capacity(text.len() + 1);
    for c in text.chars() {
        if is_plain(c) {
            safe.push(c);
        } else {
            // All of them are in the basic plane: four digits.
            safe.push_str(&format!("\\u{:04x}", u32::from(c)));
        }
    }
    safe.push('\n');
    write_as_is(&safe)
}

fn escaped(line: &str) -> String {
    match line.strip_suffix('\n') {
        Some(line) => format!("{}\n", printable(line)),
        None => printable(line).into_owned(),
    }
}

fn write_as_is(text: &str) -> io::Result<()> {
    // Log lines that were written before appear before.
    terminal::flush();
    let mut stdout = io::stdout().lock();
    match stdout.write_all(text.as_bytes()).and_then(|()| stdout.flush()) {
        Err(error) if error.kind() == io::ErrorKind::BrokenPipe => Ok(()),
        Err(error) => Err(io::Error::new(error.kind(), format!("standard output: {error}"))),
        Ok(()) => Ok(()),
    }
}
