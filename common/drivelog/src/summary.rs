//! What the end of an MCAP file says of its topics.

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

/// The topics that the summary of a file names; none if it has no summary that is intact. Leaves the source at its start.
pub(crate) fn topics<R: Read + Seek>(source: &mut R) -> io::Result<Topics> {
    let summary = summary(source)?;
    source.rewind()?;
    let (mut schemas, mut channels) = (BTreeMap::new(), BTreeMap::new());
    let mut rest = summary.as_slice();
    while let Some((opcode, body, behind)) = split_record(rest) {
        rest = behind;
        let mut fields = Fields(body);
        match opcode {
            opcode::SCHEMA => schemas.extend(schema(&mut fields)),
            opcode::CHANNEL => channels.extend(channel(&mut fields, &schemas)),
            _ => {}
        }
    }
    Ok((schemas, channels))
}

/// The bytes from the summary to the end of the file; none if there is no summary that is intact.
fn summary<R: Read + Seek>(source: &mut R) -> io::Result<Vec<u8>> {
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
        let mut source = Cursor::new(file);
        let (_, channels) = topics(&mut source).unwrap();
        assert_eq!(source.position(), 0);
        channels.into_values().map(|channel| (channel.topic, channel.format.schema_name)).collect()
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
