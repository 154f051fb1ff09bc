//! A bag of ROS 2: messages of topics, in one file or several.

use std::collections::BTreeMap;
use std::path::Path;

use drivelog::{LogError, McapReader};

use crate::damages::Damages;
use crate::error::BagError;
use crate::files::{BagFile, Readable, Storage, files};
use crate::message::{Message, Topic};
use crate::sqlite;

/// A bag that is read.
pub struct Bag {
    files: Vec<BagFile>,
}

/// What the messages of a bag are for, and what of them cannot be read.
pub(crate) struct Visit<'a> {
    wants: &'a dyn Fn(&Topic) -> bool,
    each: &'a mut dyn FnMut(Message<'_>) -> Result<(), BagError>,
    damages: Damages,
    /// The first damage, while no message has been found.
    first_error: Option<BagError>,
    has_messages: bool,
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
        let mut visit = Visit { wants, each, damages: Damages::default(), first_error: None, has_messages: false };
        for file in &self.files {
            let readable = file.readable(&mut |error| visit.damaged(error))?;
            match file.storage {
                Storage::Mcap => visit_mcap(&readable, &mut visit)?,
                Storage::Sqlite => sqlite::visit(&readable, &mut visit)?,
            }
        }
        visit.first_error.map_or(Ok(visit.damages), Err)
    }
}

impl Visit<'_> {
    pub(crate) fn wants(&self, topic: &Topic) -> bool {
        (self.wants)(topic)
    }

    /// Takes note of what cannot be read. A bag without any message is none.
    pub(crate) fn damaged(&mut self, error: BagError) {
        self.damages.add(error.to_string());
        if !self.has_messages {
            self.first_error.get_or_insert(error);
        }
    }

    /// A message has been found.
    pub(crate) fn found(&mut self) {
        self.has_messages = true;
        self.first_error = None;
    }

    /// Passes on a message by its number in its topic or, in SQLite, its table. ROS counts nanoseconds in 63 bits.
    pub(crate) fn message(&mut self, topic: &Topic, number: i64, received_ns: i128, stored: &[u8]) -> Result<(), BagError> {
        match i64::try_from(received_ns).map(u64::try_from) {
            Ok(Ok(received_ns)) => (self.each)(Message { topic, received_ns, stored }),
            Ok(Err(_)) | Err(_) => {
                let problem = format!("message {number} has the time {received_ns} ns, expected 0 to {}", i64::MAX);
                self.damaged(BagError::Topic { topic: topic.name.clone(), problem });
                Ok(())
            }
        }
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
