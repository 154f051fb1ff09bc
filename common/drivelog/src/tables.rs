//! Messages of a log as tables.

use std::collections::{BTreeMap, BTreeSet};
use std::fs::{self, File};
use std::path::{Path, PathBuf};

use csv::Writer;
use serde_json::Value;

use crate::damage::LogError;
use crate::log::Log;
use crate::table_row::{Row, TableOf, rows};

/// Longest name of a table without its extension and its number, bytes. File systems allow 255 bytes for all.
const MOST_NAME_BYTES: usize = 200;

/// The result of an export.
#[derive(Debug, Default)]
pub struct Tables {
    /// The tables, in the order of their topics.
    pub tables: Vec<Table>,
    /// What could not be read.
    pub damages: Vec<LogError>,
}

/// A table that was written.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Table {
    /// Its file.
    pub path: PathBuf,
    /// Its topic.
    pub topic: String,
    /// Lines without the heading.
    pub rows: u64,
}

/// A table that is being written.
struct Open {
    path: PathBuf,
    writer: Writer<File>,
    columns: Vec<String>,
    rows: u64,
}

/// Writes the topics whose messages are JSON into the new folder `to`: one table for each topic, with one line for each message, and one
/// for each list in its messages, with one line for each entry. The log is read twice: a table has every column that any of its lines
/// needs.
///
/// # Errors
/// When `from` is no log, or the folder exists already or cannot be written.
pub fn export_csv(from: &Path, to: &Path) -> Result<Tables, LogError> {
    let mut headings: BTreeMap<TableOf, Heading> = BTreeMap::new();
    visit(from, &mut |table, row| {
        headings.entry(table).or_default().add(&row);
        Ok(())
    })?;
    fs::create_dir(to).map_err(LogError::at(to))?;
    let mut tables: BTreeMap<TableOf, Open> = BTreeMap::new();
    let mut names = BTreeSet::new();
    for (table, Heading { columns, .. }) in headings {
        let path = to.join(file_name(&table, &mut names));
        let writer = File::create_new(&path).map(Writer::from_writer).and_then(|mut writer| {
            writer.write_record(&columns)?;
            Ok(writer)
        });
        tables.insert(table, Open { writer: writer.map_err(LogError::at(&path))?, path, columns, rows: 0 });
    }
    let damages = visit(from, &mut |table, row| {
        let Some(open) = tables.get_mut(&table) else { return Ok(()) };
        let cells: BTreeMap<&str, &str> = row.cells().collect();
        let line = open.columns.iter().map(|column| cells.get(column.as_str()).copied().unwrap_or_default());
        open.rows += 1;
        open.writer.write_record(line).map_err(|error| LogError::at(&open.path)(std::io::Error::from(error)))
    })?;
    let mut written = Tables { damages, ..Tables::default() };
    for (TableOf { topic, .. }, Open { path, mut writer, rows, .. }) in tables {
        writer.flush().map_err(LogError::at(&path))?;
        written.tables.push(Table { path, topic, rows });
    }
    Ok(written)
}

/// The columns of a table in the order in which they are found.
#[derive(Default)]
struct Heading {
    columns: Vec<String>,
    known: BTreeSet<String>,
}

impl Heading {
    fn add(&mut self, row: &Row) {
        for (column, _) in row.cells() {
            if !self.known.contains(column) {
                self.known.insert(column.to_owned());
                self.columns.push(column.to_owned());
            }
        }
    }
}

/// Calls `each` with the rows of every message in JSON. Returns what could not be read.
fn visit(from: &Path, each: &mut dyn FnMut(TableOf, Row) -> Result<(), LogError>) -> Result<Vec<LogError>, LogError> {
    let mut log = Log::open(from)?;
    let mut damages = Vec::new();
    loop {
        match log.advance() {
            Ok(true) => {}
            Ok(false) => return Ok(damages),
            Err(error) => {
                damages.push(error);
                continue;
            }
        }
        let Some(message) = log.message().filter(|message| message.channel.format.message_encoding == "json") else { continue };
        match serde_json::from_slice::<Value>(message.data) {
            Ok(value) => rows(&message.channel.topic, message.stamp_ns, &value, each)?,
            Err(error) => damages.push(log.fault(error.into())),
        }
    }
}

/// The name of a table's file, which no other table has. Topics and fields come from any program: none may name another folder.
fn file_name(table: &TableOf, names: &mut BTreeSet<String>) -> String {
    let TableOf { topic, list } = table;
    let text = if list.is_empty() { topic.clone() } else { format!("{topic}.{list}") };
    let mut name: String =
        text.chars().map(|letter| if letter.is_alphanumeric() || "-_.".contains(letter) { letter } else { '_' }).collect();
    if name.is_empty() || name.starts_with('.') {
        name.insert(0, '_');
    }
    name.truncate(name.floor_char_boundary(MOST_NAME_BYTES));
    let numbered = (2_u64..).map(|number| format!("{name}-{number}.csv"));
    let mut candidates = std::iter::once(format!("{name}.csv")).chain(numbered);
    candidates.find(|name| names.insert(name.to_lowercase())).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_files_stay_in_the_folder_and_differ() {
        let mut names = BTreeSet::new();
        let mut name = |topic: &str, list: &str| file_name(&TableOf { topic: topic.to_owned(), list: list.to_owned() }, &mut names);
        let found =
            [("robot/scan", ""), ("robot_scan", ""), ("robot/scan", "readings"), ("Robot/Scan", "")].map(|(topic, list)| name(topic, list));
        assert_eq!(found, ["robot_scan.csv", "robot_scan-2.csv", "robot_scan.readings.csv", "Robot_Scan-3.csv"]);
        let found = ["../../etc/passwd", "/etc/passwd", ".bashrc", "", "..", "a\0b\nc\\d"].map(|topic| name(topic, ""));
        assert_eq!(found, ["_.._.._etc_passwd.csv", "_etc_passwd.csv", "_.bashrc.csv", "_.csv", "_...csv", "a_b_c_d.csv"]);
        assert_eq!(name("x", "../../y"), "x..._.._y.csv");
        assert_eq!([name(&"ü".repeat(500), ""), name(&"ü".repeat(500), "")].map(|name| name.len()), [204, 206]);
    }
}
