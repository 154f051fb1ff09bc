//! A bag of ROS 2: messages of topics, in one file or several.

use std::collections::BTreeMap;
use std::path::Path;

use drivelog::{LogError, McapReader};

use crate::damages::Damages;
use crate::error::BagError;
use crate::files::{BagFile, Readable, Storage, files};
use crate::message::{Message, Topic};
use crate::sqlite;
use crate::visit::Visit;

/// A bag that is read.
pub struct Bag {
    files: Vec<BagFile>,
}

impl Bag {
    /// Opens the folder that `ros2 bag record` has written, or one of its files.
    ///
    /// # Errors
    /// When there is no bag.
    pub fn open(path: &Path) -> Result<Self, BagError> {
        Ok(Self { files: files(path)? })
    }

    /// Calls `each` with the messages of the topics that `wants` accepts, file by file in the order in which they were recorded. Returns
    /// what could not be read.
    ///
    /// # Errors
    /// The first error of `each`, that of a disk to which a file cannot be unpacked, or the first damage of a bag of which no message can
    /// be read.
    pub(crate) fn visit(
        &self,
        wants: &dyn Fn(&Topic) -> bool,
        each: &mut dyn FnMut(Message<'_>) -> Result<(), BagError>,
    ) -> Result<Damages, BagError> {
        let mut visit = Visit::new(wants, each);
        for file in &self.files {
            let readable = file.readable(&mut |error| visit.damaged(error))?;
            match file.storage {
                Storage::Mcap => visit_mcap(&readable, &mut visit)?,
                Storage::Sqlite => sqlite::visit(&readable, &mut visit)?,
            }
        }
        visit.end()
    }
}

fn visit_mcap(file: &Readable<'_>, visit: &mut Visit<'_>) -> Result<(), BagError> {
    let named = |error: LogError| BagError::from(LogError { path: file.path.to_owned(), ..error });
    let mut reader = match McapReader::open(file.storage()) {
        Ok(reader) => reader,
        Err(error) => {
            visit.damaged(named(error));
            return Ok(());
        }
    };
    // By name, those of different types apart.
    let mut topics: BTreeMap<String, Vec<Seen>> = BTreeMap::new();
    loop {
        match reader.advance() {
            Ok(true) => visit.found(),
            Ok(false) => break,
            Err(error) => {
                visit.damaged(named(error));
                continue;
            }
        }
        let Some(message) = reader.message() else { continue };
        let (name, format) = (&message.channel.topic, &message.channel.format);
        let of_name = match topics.get_mut(name) {
            Some(of_name) => of_name,
            None => topics.entry(name.clone()).or_default(),
        };
        let is_this = |seen: &Seen| seen.topic.type_name == format.schema_name && seen.topic.encoding == format.message_encoding;
        let place = of_name.iter().position(is_this).unwrap_or_else(|| {
            let topic = Topic { name: name.clone(), type_name: format.schema_name.clone(), encoding: format.message_encoding.clone() };
            of_name.push(Seen { is_wanted: visit.wants(&topic), topic, messages: 0 });
            of_name.len() - 1
        });
        let Some(seen) = of_name.get_mut(place).filter(|seen| seen.is_wanted) else { continue };
        seen.messages += 1;
        visit.message(&seen.topic, seen.messages, message.log_ns.into(), message.data)?;
    }
    if let Some(offset) = reader.cut_at() {
        visit.damaged(BagError::Cut { path: file.path.to_owned(), offset });
    }
    Ok(())
}

/// A topic of an MCAP file.
struct Seen {
    topic: Topic,
    is_wanted: bool,
    messages: i64,
}
