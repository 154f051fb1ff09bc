//! A bag as `ros2 bag record --storage mcap` writes it: a folder with `metadata.yaml` and one MCAP file.

use std::collections::BTreeMap;
use std::fs::{self, File};
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};

use drivelog::LogError;
use mcap::records::MessageHeader;
use mcap::{Compression, WriteOptions};

use crate::error::BagError;

/// A type of message with the text of its definition.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Type {
    pub(crate) name: &'static str,
    pub(crate) definition: &'static str,
}

/// A topic that is written.
#[derive(Debug, Clone, PartialEq, Eq)]
struct Written {
    channel: u16,
    of: Type,
    messages: u64,
}

/// Writes a bag.
pub(crate) struct BagWriter {
    folder: PathBuf,
    file_name: String,
    writer: mcap::Writer<BufWriter<File>>,
    topics: BTreeMap<String, Written>,
    /// Times of the first message and of the last.
    span_ns: Option<(u64, u64)>,
}

impl BagWriter {
    /// A bag in a new folder.
    pub(crate) fn create(folder: &Path) -> Result<Self, BagError> {
        fs::create_dir(folder).map_err(BagError::io(folder))?;
        let name = folder.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
        let file_name = format!("{name}_0.mcap");
        let path = folder.join(&file_name);
        let file = File::create_new(&path).map_err(BagError::io(&path))?;
        let options = WriteOptions::new().profile("ros2").compression(Some(Compression::Lz4));
        let options = options.library(concat!("stillmap ", env!("CARGO_PKG_VERSION")));
        let writer = options.create(BufWriter::new(file)).map_err(refused(folder))?;
        Ok(Self { folder: folder.to_owned(), file_name, writer, topics: BTreeMap::new(), span_ns: None })
    }

    /// Adds a message in CDR. Messages are added in the order of their times.
    pub(crate) fn add(&mut self, topic: &str, of: Type, time_ns: u64, data: &[u8]) -> Result<(), BagError> {
        if !self.topics.contains_key(topic) {
            let schema = self.writer.add_schema(of.name, "ros2msg", of.definition.as_bytes()).map_err(refused(&self.folder))?;
            let channel = self.writer.add_channel(schema, topic, "cdr", &properties(topic)).map_err(refused(&self.folder))?;
            self.topics.insert(topic.to_owned(), Written { channel, of, messages: 0 });
        }
        let Some(written) = self.topics.get_mut(topic) else { return Ok(()) };
        written.messages += 1;
        let header =
            MessageHeader { channel_id: written.channel, sequence: written.messages as u32, log_time: time_ns, publish_time: time_ns };
        self.span_ns = Some((self.span_ns.map_or(time_ns, |(first_ns, _)| first_ns), time_ns));
        self.writer.write_to_known_channel(&header, data).map_err(refused(&self.folder))
    }

    /// Messages by topic.
    pub(crate) fn counts(&self) -> BTreeMap<String, u64> {
        self.topics.iter().map(|(topic, written)| (topic.clone(), written.messages)).collect()
    }

    /// Writes the index and the description of the bag.
    pub(crate) fn finish(mut self) -> Result<(), BagError> {
        self.writer.finish().map_err(refused(&self.folder))?;
        let metadata = self.metadata();
        let mut file = self.writer.into_inner();
        let path = self.folder.join(&self.file_name);
        file.flush().map_err(BagError::io(&path))?;
        let path = self.folder.join("metadata.yaml");
        fs::write(&path, metadata).map_err(BagError::io(&path))
    }

    /// The description in version 5, which every ROS 2 from Humble on reads.
    fn metadata(&self) -> String {
        let (first_ns, last_ns) = self.span_ns.unwrap_or_default();
        let duration_ns = last_ns - first_ns;
        let messages: u64 = self.topics.values().map(|written| written.messages).sum();
        let file = yaml(&self.file_name);
        let mut text = format!(
            "rosbag2_bagfile_information:\n  version: 5\n  storage_identifier: mcap\n  duration:\n    nanoseconds: {duration_ns}\n  starting_time:\n    \
             nanoseconds_since_epoch: {first_ns}\n  message_count: {messages}\n  topics_with_message_count:\n"
        );
        for (topic, Written { of, messages, .. }) in &self.topics {
            let (topic, qos) = (yaml(topic), yaml(qos(topic)));
            text += &format!(
                "    - topic_metadata:\n        name: {topic}\n        type: {}\n        serialization_format: cdr\n        \
                 offered_qos_profiles: {qos}\n      message_count: {messages}\n",
                of.name
            );
        }
        text += &format!(
            "  compression_format: \"\"\n  compression_mode: \"\"\n  relative_file_paths:\n    - {file}\n  files:\n    - path: {file}\n      \
             starting_time:\n        nanoseconds_since_epoch: {first_ns}\n      duration:\n        nanoseconds: {duration_ns}\n      \
             message_count: {messages}\n"
        );
        text
    }
}

fn refused(folder: &Path) -> impl FnOnce(mcap::McapError) -> BagError {
    move |error| LogError::writing(folder)(error.into()).into()
}

fn properties(topic: &str) -> BTreeMap<String, String> {
    BTreeMap::from([("offered_qos_profiles".to_owned(), qos(topic).to_owned())])
}

/// The profile with which a topic is played. A late reader receives the last map and the mounts: durability 1 is transient local.
fn qos(topic: &str) -> &'static str {
    if topic == "/tf_static" || topic.starts_with("/map") {
        "- history: 1\n  depth: 1\n  reliability: 1\n  durability: 1\n  deadline:\n    sec: 9223372036\n    nsec: 854775807\n  lifespan:\n    \
         sec: 9223372036\n    nsec: 854775807\n  liveliness: 1\n  liveliness_lease_duration:\n    sec: 9223372036\n    nsec: 854775807\n  \
         avoid_ros_namespace_conventions: false"
    } else {
        ""
    }
}

/// A text in YAML.
fn yaml(text: &str) -> String {
    format!("{:?}", text).replace("\\'", "'")
}
