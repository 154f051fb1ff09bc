//! Bags in SQLite.

use std::path::Path;

use rusqlite::{Connection, OpenFlags};

use crate::error::BagError;
use crate::message::{Message, Topic};

/// Calls `each` with the messages of the topics that `wants` accepts, in the order in which they were recorded.
pub(crate) fn visit(
    path: &Path,
    wants: &dyn Fn(&Topic) -> bool,
    each: &mut dyn FnMut(Message<'_>) -> Result<(), BagError>,
) -> Result<(), BagError> {
    let fault = |error| BagError::sqlite(path)(error);
    let bag = Connection::open_with_flags(path, OpenFlags::SQLITE_OPEN_READ_ONLY).map_err(fault)?;
    let mut topics = bag.prepare("SELECT id, name, type, serialization_format FROM topics ORDER BY id").map_err(fault)?;
    let topics = topics.query_map([], |row| Ok((row.get(0)?, Topic { name: row.get(1)?, type_name: row.get(2)?, encoding: row.get(3)? })));
    let topics: Vec<(i64, Topic)> = topics.and_then(Iterator::collect).map_err(fault)?;
    let wanted: Vec<&(i64, Topic)> = topics.iter().filter(|(_, topic)| wants(topic)).collect();
    if wanted.is_empty() {
        return Ok(());
    }
    let ids: Vec<String> = wanted.iter().map(|(id, _)| id.to_string()).collect();
    let query = format!("SELECT topic_id, timestamp, data FROM messages WHERE topic_id IN ({}) ORDER BY id", ids.join(", "));
    let mut messages = bag.prepare(&query).map_err(fault)?;
    let mut rows = messages.query([]).map_err(fault)?;
    while let Some(row) = rows.next().map_err(fault)? {
        let (id, received_ns): (i64, i64) = (row.get(0).map_err(fault)?, row.get(1).map_err(fault)?);
        let data = row.get_ref(2).map_err(fault)?.as_blob().map_err(|error| fault(error.into()))?;
        let Some((_, topic)) = wanted.iter().find(|(wanted, _)| *wanted == id) else { continue };
        each(Message { topic, received_ns: u64::try_from(received_ns).unwrap_or_default(), data })?;
    }
    Ok(())
}
