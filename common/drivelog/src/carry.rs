//! Messages that could not be written into their file, for the next file of the log.

use std::collections::BTreeMap;

use crate::chunk::unpack;
use crate::damage::WriteError;
use crate::deframer::{MAGIC, opcode, split_record};
use crate::fields::Fields;
use crate::message_reader::position;
use crate::records::Channel;
use crate::writer::{LogWriter, Times};

/// Adds the messages of the chunks in `bytes` to another part. The bytes are complete records of a part with these channels.
pub(crate) fn carry(bytes: &[u8], channels: &BTreeMap<u16, Channel>, into: &mut LogWriter) -> Result<(), WriteError> {
    // Bytes of which nothing is written begin as the file does.
    for (_, body) in records(bytes.strip_prefix(MAGIC).unwrap_or(bytes)).filter(|(opcode, _)| *opcode == opcode::CHUNK) {
        // The writer has made these chunks: they can be unpacked.
        let Ok(content) = unpack(0, body) else { continue };
        for (_, body) in records(&content).filter(|(opcode, _)| *opcode == opcode::MESSAGE) {
            let Some(message) = position(&mut Fields(body), body.len()) else { continue };
            let (Some(channel), Some(data)) = (channels.get(&message.channel), body.get(message.data)) else { continue };
            let times = Times { log_ns: message.log_ns, stamp_ns: message.stamp_ns };
            into.raw(&channel.topic, || channel.format.clone(), times, message.sequence, data)?;
        }
    }
    Ok(())
}

/// The complete records at the start of these bytes.
fn records(bytes: &[u8]) -> impl Iterator<Item = (u8, &[u8])> {
    let mut rest = bytes;
    std::iter::from_fn(move || {
        let (opcode, body, behind) = split_record(rest)?;
        rest = behind;
        Some((opcode, body))
    })
}
