//! What the end of an MCAP file says of its topics and chunks.

use std::collections::BTreeMap;
use std::io::{self, Read, Seek, SeekFrom};

use crate::chunk::MAX_RECORD;
use crate::deframer::{MAGIC, opcode, split_record};
use crate::fields::Fields;
use crate::records::{Channel, Schema, channel, schema};

/// Opcode and length of the footer, its fields, and the magic bytes behind it.
const FOOTER: u64 = 1 + 8 + 20 + MAGIC.len() as u64;
/// The checksum of the summary, which is the last field of the footer, and the magic bytes.
const UNCHECKED: usize = 4 + MAGIC.len();

/// Schemas and channels by their numbers.
pub(crate) type Topics = (BTreeMap<u16, Schema>, BTreeMap<u16, Channel>);

/// The summary of a file.
#[derive(Default)]
pub(crate) struct Summary {
    pub(crate) topics: Topics,
    /// The chunks in the order in which they stand in the file.
    pub(crate) chunks: Vec<ChunkPlace>,
}

/// Where a chunk stands.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct ChunkPlace {
    pub(crate) offset: u64,
    /// Bytes of its record.
    pub(crate) length: u64,
    /// Log time of its last message.
    pub(crate) last_ns: u64,
}

impl Summary {
    /// The summary of a file; an empty one if it has none that is intact. Leaves the source anywhere.
    pub(crate) fn read<R: Read + Seek>(source: &mut R) -> io::Result<Self> {
        let bytes = bytes(source)?;
        let mut summary = Self::default();
        let (schemas, channels) = &mut summary.topics;
        let mut rest = bytes.as_slice();
        while let Some((opcode, body, behind)) = split_record(rest) {
            rest = behind;
            let mut fields = Fields(body);
            match opcode {
                opcode::SCHEMA => schemas.extend(schema(&mut fields)),
                opcode::CHANNEL => channels.extend(channel(&mut fields, schemas)),
                opcode::CHUNK_INDEX => summary.chunks.extend(chunk_place(&mut fields)),
                _ => {}
            }
        }
        summary.chunks.sort_unstable();
        Ok(summary)
    }

    /// Where reading for messages from this log time on may begin; `None` when it has to begin with the first chunk.
    pub(crate) fn start(&self, from_ns: u64) -> Option<u64> {
        let earlier = self.chunks.iter().take_while(|chunk| chunk.last_ns < from_ns);
        earlier.last().map(|chunk| chunk.offset.saturating_add(chunk.length))
    }
}

fn chunk_place(fields: &mut Fields<'_>) -> Option<ChunkPlace> {
    let (_first_ns, last_ns) = (fields.u64()?, fields.u64()?);
    Some(ChunkPlace { last_ns, offset: fields.u64()?, length: fields.u64()? })
}

/// The bytes from the summary to the end of the file; none if there is no summary that is intact.
fn bytes<R: Read + Seek>(source: &mut R) -> io::Result<Vec<u8>> {
    let size = source.seek(SeekFrom::End(0))?;
    let Some(footer_at) = size.checked_sub(FOOTER) else { return Ok(Vec::new()) };
    source.seek(SeekFrom::Start(footer_at))?;
    let mut footer = Vec::new();
    source.take(FOOTER).read_to_end(&mut footer)?;
    let start = match split_record(&footer) {
        Some((opcode::FOOTER, body, _)) => Fields(body).u64().filter(|start| (1..footer_at).contains(start)),
        _ => None,
    };
    let Some(start) = start.filter(|start| footer_at - start <= MAX_RECORD) else { return Ok(Vec::new()) };
    source.seek(SeekFrom::Start(start))?;
    let mut summary = Vec::new();
    source.take(size - start).read_to_end(&mut summary)?;
    let (checked, rest) = summary.split_at(summary.len().saturating_sub(UNCHECKED));
    // 0 stands for no checksum.
    let is_intact = Fields(rest).u32().is_some_and(|crc| crc == 0 || crc == crc32fast::hash(checked));
    Ok(if is_intact { summary } else { Vec::new() })
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Cursor;

    fn file() -> Vec<u8> {
        let mut writer = mcap::Writer::new(Cursor::new(Vec::new())).unwrap();
        let schema = writer.add_schema("a_type", "ros2msg", b"").unwrap();
        writer.add_channel(schema, "/topic", "cdr", &BTreeMap::new()).unwrap();
        writer.finish().unwrap();
        writer.into_inner().into_inner()
    }

    fn names(file: &[u8]) -> Vec<(String, String)> {
        let (_, channels) = Summary::read(&mut Cursor::new(file)).unwrap().topics;
        channels.into_values().map(|channel| (channel.topic, channel.format.schema_name)).collect()
    }

    #[test]
    fn reading_begins_behind_the_chunks_that_are_earlier() {
        let chunk = |offset, last_ns| ChunkPlace { offset, length: 10, last_ns };
        let summary = Summary { chunks: vec![chunk(8, 5), chunk(20, 9), chunk(32, 7)], ..Summary::default() };
        let starts = [0, 5, 6, 8, 9, 10, u64::MAX].map(|from_ns| summary.start(from_ns));
        assert_eq!(starts, [None, None, Some(18), Some(18), Some(18), Some(42), Some(42)]);
        assert_eq!(Summary::default().start(9), None);
    }

    #[test]
    fn an_intact_summary_names_the_topics() {
        let file = file();
        assert_eq!(names(&file), [("/topic".to_owned(), "a_type".to_owned())]);
        // A file that is cut has no summary, and one with another byte in it none that can be trusted.
        for end in 0..file.len() {
            assert!(names(&file[..end]).is_empty(), "{end}");
        }
        for place in file.len() - FOOTER as usize - 40..file.len() - MAGIC.len() {
            let mut changed = file.clone();
            changed[place] ^= 1;
            assert!(names(&changed).is_empty(), "{place}");
        }
    }
}
