//! A bag of ROS 2: messages of topics, in one file or several.

use std::borrow::Cow;
use std::io::Read;
use std::path::Path;

use drivelog::McapReader;

use crate::error::BagError;
use crate::files::{BagFile, Storage, files};
use crate::message::{Message, Topic};
use crate::sqlite;

/// What a message starts with that `ros2 bag record --compression-mode message` has packed.
const ZSTD_MAGIC: [u8; 4] = [0x28, 0xb5, 0x2f, 0xfd];
/// The largest message that is unpacked, bytes: as for a chunk of an MCAP file.
const MAX_MESSAGE: u64 = 64 << 20;

/// A bag that is read.
pub struct Bag {
    files: Vec<BagFile>,
}

impl Bag {
    /// Opens the folder that `ros2 bag record` has written, or one of its files.
    ///
    /// # Errors
    /// When there is no bag, or a packed file cannot be unpacked.
    pub fn open(path: &Path) -> Result<Self, BagError> {
        Ok(Self { files: files(path)? })
    }

    /// Calls `each` with the messages of the topics that `wants` accepts, file by file in the order in which they were recorded. Returns
    /// what could not be read.
    pub(crate) fn visit(
        &self,
        wants: &dyn Fn(&Topic) -> bool,
        each: &mut dyn FnMut(Message<'_>) -> Result<(), BagError>,
    ) -> Result<Vec<String>, BagError> {
        let mut damages = Vec::new();
        let mut unpacking = |message: Message<'_>| match unpack(message.data) {
            Ok(data) => each(Message { data: &data, ..message }),
            Err(problem) => Err(BagError::Topic { topic: message.topic.name.clone(), problem }),
        };
        for file in &self.files {
            match file.storage {
                Storage::Mcap => visit_mcap(file, wants, &mut unpacking, &mut damages)?,
                Storage::Sqlite => sqlite::visit(file.readable(), wants, &mut unpacking)?,
            }
        }
        Ok(damages)
    }
}

fn visit_mcap(
    file: &BagFile,
    wants: &dyn Fn(&Topic) -> bool,
    each: &mut dyn FnMut(Message<'_>) -> Result<(), BagError>,
    damages: &mut Vec<String>,
) -> Result<(), BagError> {
    let mut reader = McapReader::open(file.readable())?;
    let (mut topics, mut has_messages): (Vec<(Topic, bool)>, bool) = (Vec::new(), false);
    loop {
        match reader.advance() {
            Ok(true) => has_messages = true,
            Ok(false) => break,
            // A file without any message is no bag.
            Err(error) if !has_messages => return Err(error.into()),
            Err(error) => {
                damages.push(error.to_string());
                continue;
            }
        }
        let Some(message) = reader.message() else { continue };
        let (name, format) = (&message.channel.topic, &message.channel.format);
        let place = topics.iter().position(|(topic, _)| topic.name == *name && topic.type_name == format.schema_name);
        let place = place.unwrap_or_else(|| {
            let topic = Topic { name: name.clone(), type_name: format.schema_name.clone(), encoding: format.message_encoding.clone() };
            let is_wanted = wants(&topic);
            topics.push((topic, is_wanted));
            topics.len() - 1
        });
        let Some((topic, true)) = topics.get(place) else { continue };
        each(Message { topic, received_ns: message.log_ns, data: message.data })?;
    }
    if let Some(offset) = reader.cut_at() {
        damages.push(format!("{}: is cut at byte {offset}", file.path.display()));
    }
    Ok(())
}

/// The bytes of a message, which may be packed by itself.
fn unpack(data: &[u8]) -> Result<Cow<'_, [u8]>, String> {
    if !data.starts_with(&ZSTD_MAGIC) {
        return Ok(Cow::Borrowed(data));
    }
    let decoder = ruzstd::decoding::StreamingDecoder::new(data).map_err(|error| error.to_string())?;
    let mut unpacked = Vec::new();
    decoder.take(MAX_MESSAGE).read_to_end(&mut unpacked).map_err(|error| error.to_string())?;
    Ok(Cow::Owned(unpacked))
}
