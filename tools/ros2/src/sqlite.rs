//! Bags in SQLite.

use std::collections::BTreeMap;

use rusqlite::limits::Limit;
use rusqlite::{Connection, OpenFlags};

use crate::error::BagError;
use crate::files::Readable;
use crate::message::{MAX_MESSAGE, Topic};
use crate::visit::Visit;

/// Passes on the messages in the order in which they were recorded.
pub(crate) fn visit(file: &Readable<'_>, visit: &mut Visit<'_>) -> Result<(), BagError> {
    match read(file, visit) {
        Err(error @ (BagError::Sqlite { .. } | BagError::NoTable { .. })) => {
            visit.damaged(error);
            Ok(())
        }
        done => done,
    }
}

fn read(file: &Readable<'_>, visit: &mut Visit<'_>) -> Result<(), BagError> {
    let fault = |error| BagError::sqlite(file.path)(error);
    let bag = Connection::open_with_flags(file.storage(), OpenFlags::SQLITE_OPEN_READ_ONLY).map_err(fault)?;
    // The schema comes from any program: it must neither call functions nor ask for any memory.
    bag.pragma_update(None, "trusted_schema", false).map_err(fault)?;
    bag.set_limit(Limit::SQLITE_LIMIT_LENGTH, MAX_MESSAGE as i32).map_err(fault)?;
    for table in ["topics", "messages"] {
        check(&bag, table).map_err(fault)?.then_some(()).ok_or(BagError::NoTable { path: file.path.to_owned(), table })?;
    }
    let topics = topics(&bag, file, visit).map_err(fault)?;
    if topics.is_empty() {
        return Ok(());
    }
    let ids: Vec<String> = topics.keys().map(i64::to_string).collect();
    // A message that is too large is passed over; to read it would end the query.
    let query = format!(
        "SELECT id, topic_id, timestamp, CASE WHEN typeof(data) = 'blob' AND length(data) <= {MAX_MESSAGE} THEN data END \
         FROM messages WHERE topic_id IN ({}) ORDER BY id",
        ids.join(", ")
    );
    let mut messages = bag.prepare(&query).map_err(fault)?;
    let mut rows = messages.query([]).map_err(fault)?;
    while let Some(row) = rows.next().map_err(fault)? {
        visit.found();
        let (id, topic_id): (i64, i64) = (row.get(0).map_err(fault)?, row.get(1).map_err(fault)?);
        let Some(topic) = topics.get(&topic_id) else { continue };
        let data = row.get_ref(3).map_err(fault)?;
        match (row.get::<_, i64>(2), data.as_blob()) {
            (Ok(time_ns), Ok(data)) => visit.message(topic, id, time_ns.into(), data)?,
            (Ok(_), Err(_)) => {
                let problem = format!("message {id} has no data of at most {MAX_MESSAGE} bytes");
                visit.damaged(BagError::Topic { topic: topic.name.clone(), problem });
            }
            (Err(_), _) => visit.damaged(BagError::Topic { topic: topic.name.clone(), problem: format!("message {id} has no time") }),
        }
    }
    Ok(())
}

/// Whether this is a table whose columns are all stored in it.
fn check(bag: &Connection, table: &str) -> rusqlite::Result<bool> {
    let query = "SELECT EXISTS (SELECT 1 FROM sqlite_schema WHERE type = 'table' AND name = ?1 AND rootpage > 0) \
                 AND NOT EXISTS (SELECT 1 FROM pragma_table_xinfo(?1) WHERE hidden <> 0)";
    bag.query_row(query, [table], |row| row.get(0))
}

/// The topics that are wanted, by their numbers.
fn topics(bag: &Connection, file: &Readable<'_>, visit: &mut Visit<'_>) -> rusqlite::Result<BTreeMap<i64, Topic>> {
    let mut wanted = BTreeMap::new();
    let mut query = bag.prepare("SELECT id, name, type, serialization_format FROM topics ORDER BY id")?;
    let mut rows = query.query([])?;
    while let Some(row) = rows.next()? {
        let topic = row.get(1).and_then(|name| Ok(Topic { name, type_name: row.get(2)?, encoding: row.get(3)? }));
        match (row.get(0), topic) {
            (Ok(id), Ok(topic)) => {
                if visit.wants(&topic) {
                    wanted.entry(id).or_insert(topic);
                }
            }
            (Err(error), _) | (_, Err(error)) => visit.damaged(BagError::sqlite(file.path)(error)),
        }
    }
    Ok(wanted)
}
