//! A message in JSON as rows of tables.

use std::collections::BTreeSet;

use serde_json::Value;

use crate::damage::LogError;

/// What a table is of.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct TableOf {
    pub(crate) topic: String,
    /// The list in its messages, by the names of the fields that lead to it; empty for the messages themselves.
    pub(crate) list: String,
}

/// A line of a table: the name of each column with its cell. No two have the same name.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub(crate) struct Row {
    cells: Vec<(String, String)>,
    columns: BTreeSet<String>,
}

impl Row {
    /// Columns and cells in their order.
    pub(crate) fn cells(&self) -> impl Iterator<Item = (&str, &str)> {
        self.cells.iter().map(|(column, cell)| (column.as_str(), cell.as_str()))
    }

    /// Adds a cell; its column is numbered if the row has one of this name.
    fn add(&mut self, column: &str, cell: String) {
        let column = if column.is_empty() { "value" } else { column };
        let numbered = (2_u64..).map(|number| format!("{column}.{number}"));
        let mut names = std::iter::once(column.to_owned()).chain(numbered);
        let Some(name) = names.find(|name| !self.columns.contains(name)) else { return };
        self.columns.insert(name.clone());
        self.cells.push((name, cell));
    }
}

/// Calls `each` with the rows of a message: one in the table of its topic, and one for each entry of its lists in their tables.
pub(crate) fn rows(
    topic: &str,
    stamp_ns: u64,
    message: &Value,
    each: &mut dyn FnMut(TableOf, Row) -> Result<(), LogError>,
) -> Result<(), LogError> {
    let mut row = Row::default();
    row.add("stamp_ns", stamp_ns.to_string());
    let mut keys = row.clone();
    keys.add("seq", message.get("seq").map(cell).unwrap_or_default());
    let mut lists = Lists { topic, each };
    lists.row(&Nesting { list: "", keys: &keys, is_message: true }, message, row)
}

/// Where in a message a value stands.
struct Nesting<'a> {
    /// The list that has it; empty for the message.
    list: &'a str,
    /// What the rows of lists in it begin with.
    keys: &'a Row,
    is_message: bool,
}

struct Lists<'a> {
    topic: &'a str,
    each: &'a mut dyn FnMut(TableOf, Row) -> Result<(), LogError>,
}

impl Lists<'_> {
    /// The row of a message or an entry, and before it those of the lists in it.
    fn row(&mut self, place: &Nesting<'_>, value: &Value, mut row: Row) -> Result<(), LogError> {
        self.flatten(place, "", value, &mut row)?;
        (self.each)(TableOf { topic: self.topic.to_owned(), list: place.list.to_owned() }, row)
    }

    /// Adds a value as one column or, if it has fields or entries, as several. A list of a message and one with objects in it become tables.
    fn flatten(&mut self, place: &Nesting<'_>, name: &str, value: &Value, row: &mut Row) -> Result<(), LogError> {
        match value {
            Value::Object(fields) => fields.iter().try_for_each(|(field, value)| self.flatten(place, &join(name, field), value, row)),
            Value::Array(entries) if place.is_message || entries.iter().any(has_fields) => self.list(place, name, entries),
            Value::Array(entries) => {
                entries.iter().enumerate().try_for_each(|(index, value)| self.flatten(place, &join(name, &index.to_string()), value, row))
            }
            single => {
                row.add(name, cell(single));
                Ok(())
            }
        }
    }

    /// The rows of a list. Each has the number of its entry and, in a list in another, those of the entries that it is in.
    fn list(&mut self, place: &Nesting<'_>, name: &str, entries: &[Value]) -> Result<(), LogError> {
        let name = if name.is_empty() { "value" } else { name };
        let list = join(place.list, name);
        for (index, entry) in entries.iter().enumerate() {
            let (mut row, mut keys) = (place.keys.clone(), place.keys.clone());
            row.add("index", index.to_string());
            keys.add(&join(&list, "index"), index.to_string());
            self.row(&Nesting { list: &list, keys: &keys, is_message: false }, entry, row)?;
        }
        Ok(())
    }
}

fn has_fields(value: &Value) -> bool {
    match value {
        Value::Object(_) => true,
        Value::Array(entries) => entries.iter().any(has_fields),
        _ => false,
    }
}

fn join(name: &str, part: &str) -> String {
    if name.is_empty() { part.to_owned() } else { format!("{name}.{part}") }
}

/// A value as a cell: a text without quotation marks.
fn cell(value: &Value) -> String {
    match value {
        Value::String(text) => text.clone(),
        Value::Null => String::new(),
        other => other.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The rows of a message, each as its table and its cells.
    fn check(message: &str, expect: &[(&str, &str)]) {
        let mut found = Vec::new();
        rows("t", 7, &serde_json::from_str(message).unwrap(), &mut |table, row| {
            let cells: Vec<String> = row.cells().map(|(column, cell)| format!("{column}={cell}")).collect();
            found.push((table.list, cells.join(" ")));
            Ok(())
        })
        .unwrap();
        let expect: Vec<_> = expect.iter().map(|(list, cells)| ((*list).to_owned(), (*cells).to_owned())).collect();
        assert_eq!(found, expect, "{message}");
    }

    #[test]
    fn a_list_in_a_list_is_a_table_with_both_indices() {
        check(
            r#"{"seq":3,"a":{"b":[{"x":1,"c":[{"y":2},{"z":3}]},{"c":[]}]}}"#,
            &[
                ("a.b.c", "stamp_ns=7 seq=3 a.b.index=0 index=0 y=2"),
                ("a.b.c", "stamp_ns=7 seq=3 a.b.index=0 index=1 z=3"),
                ("a.b", "stamp_ns=7 seq=3 index=0 x=1"),
                ("a.b", "stamp_ns=7 seq=3 index=1"),
                ("", "stamp_ns=7 seq=3"),
            ],
        );
    }

    #[test]
    fn numbers_in_a_list_in_a_list_are_columns() {
        check(
            r#"{"a":[[1,2],[3]]}"#,
            &[("a", "stamp_ns=7 seq= index=0 0=1 1=2"), ("a", "stamp_ns=7 seq= index=1 0=3"), ("", "stamp_ns=7")],
        );
    }

    #[test]
    fn columns_of_one_name_are_numbered() {
        check(r#"{"stamp_ns":1,"a":{"b":2},"a.b":3}"#, &[("", "stamp_ns=7 stamp_ns.2=1 a.b=2 a.b.2=3")]);
    }

    #[test]
    fn a_message_without_fields_is_a_row_too() {
        check("5", &[("", "stamp_ns=7 value=5")]);
        check(
            r#"["x",null]"#,
            &[("value", "stamp_ns=7 seq= index=0 value=x"), ("value", "stamp_ns=7 seq= index=1 value="), ("", "stamp_ns=7")],
        );
    }
}
