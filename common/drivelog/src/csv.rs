//! Messages of a log as tables.

use std::collections::BTreeMap;
use std::fs::{self, File};
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};

use serde_json::Value;

use crate::damage::LogError;
use crate::log::Log;

/// The result of an export.
#[derive(Debug, Default)]
pub struct Tables {
    /// Lines without the heading, by file.
    pub rows: BTreeMap<PathBuf, u64>,
    /// What could not be read.
    pub damages: Vec<LogError>,
}

/// A table that is written.
struct Table {
    file: BufWriter<File>,
    columns: Vec<String>,
    rows: u64,
}

/// Writes the topics whose messages are JSON into the new folder `to`: one table for each topic, with one line for each message, and one
/// for each list in its messages, with one line for each entry.
///
/// # Errors
/// When the folder exists already or cannot be written.
pub fn export_csv(log: &mut Log, to: &Path) -> Result<Tables, LogError> {
    fs::create_dir(to).map_err(LogError::at(to))?;
    let mut tables: BTreeMap<PathBuf, Table> = BTreeMap::new();
    let mut damages = Vec::new();
    loop {
        match log.advance() {
            Ok(true) => {}
            Ok(false) => break,
            Err(error) => {
                damages.push(error);
                continue;
            }
        }
        let Some(message) = log.message().filter(|message| message.channel.format.message_encoding == "json") else { continue };
        let value: Value = match serde_json::from_slice(message.data) {
            Ok(value) => value,
            Err(error) => {
                damages.push(log.fault(error.into()));
                continue;
            }
        };
        let name = message.channel.topic.replace('/', "_");
        let Value::Object(fields) = value else { continue };
        let keys = [("stamp_ns".to_owned(), message.stamp_ns.to_string())];
        let mut row = keys.to_vec();
        for (field, value) in &fields {
            match value {
                Value::Array(entries) => {
                    let mut keys = keys.to_vec();
                    keys.push(("seq".to_owned(), fields.get("seq").map(Value::to_string).unwrap_or_default()));
                    for (index, entry) in entries.iter().enumerate() {
                        let mut row = keys.clone();
                        row.push(("index".to_owned(), index.to_string()));
                        flatten("", entry, &mut row);
                        add(&mut tables, to.join(format!("{name}.{field}.csv")), &row)?;
                    }
                }
                single => flatten(field, single, &mut row),
            }
        }
        add(&mut tables, to.join(format!("{name}.csv")), &row)?;
    }
    let mut written = Tables { damages, ..Tables::default() };
    for (path, mut table) in tables {
        table.file.flush().map_err(LogError::at(&path))?;
        written.rows.insert(path, table.rows);
    }
    Ok(written)
}

/// Adds a value as one column or, if it has fields or entries, as several.
fn flatten(name: &str, value: &Value, row: &mut Vec<(String, String)>) {
    let column = |part: &str| if name.is_empty() { part.to_owned() } else { format!("{name}.{part}") };
    match value {
        Value::Object(fields) => fields.iter().for_each(|(field, value)| flatten(&column(field), value, row)),
        Value::Array(entries) => entries.iter().enumerate().for_each(|(index, value)| flatten(&column(&index.to_string()), value, row)),
        Value::String(text) => row.push((column_or_value(name), quoted(text))),
        Value::Null => row.push((column_or_value(name), String::new())),
        number => row.push((column_or_value(name), number.to_string())),
    }
}

fn column_or_value(name: &str) -> String {
    if name.is_empty() { "value".to_owned() } else { name.to_owned() }
}

/// A text as a field of a table.
fn quoted(text: &str) -> String {
    if text.contains([',', '"', '\n', '\r']) { format!("\"{}\"", text.replace('"', "\"\"")) } else { text.to_owned() }
}

/// Adds a row, in the columns of the table's first row; a list that has another length leaves cells empty.
fn add(tables: &mut BTreeMap<PathBuf, Table>, path: PathBuf, row: &[(String, String)]) -> Result<(), LogError> {
    let fault = |error| LogError::at(&path)(error);
    if !tables.contains_key(&path) {
        let columns: Vec<String> = row.iter().map(|(column, _)| column.clone()).collect();
        let mut file = BufWriter::new(File::create_new(&path).map_err(fault)?);
        writeln!(file, "{}", columns.join(",")).map_err(LogError::at(&path))?;
        tables.insert(path.clone(), Table { file, columns, rows: 0 });
    }
    let Some(table) = tables.get_mut(&path) else { return Ok(()) };
    let cell = |column: &String| row.iter().find(|(name, _)| name == column).map_or("", |(_, value)| value.as_str());
    let cells: Vec<&str> = table.columns.iter().map(cell).collect();
    table.rows += 1;
    writeln!(table.file, "{}", cells.join(",")).map_err(LogError::at(&path))
}
