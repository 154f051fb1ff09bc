//! The last answers of a process, which are part of its state.

use std::collections::VecDeque;

use bus::{BusError, Writer};
use messages::{Payload, StreamCursor};

/// The last messages that a process published on a stream, as many as the history of the stream holds.
///
/// The history of a stream is lost with its sender. A consumer that dies with the sender resumes from a checkpoint that may lie
/// before that of the sender: the messages in between were published, and no process computes them again. So the sender saves
/// them with its state and [republishes](crate::Answers::new) them after a restart. Readers drop what they have received.
///
/// ```
/// use messages::{FilterVerdict, StreamCursor};
/// use stillmap_runtime::Recent;
///
/// let mut recent = Recent::default();
/// recent.note(StreamCursor { seq: 7, stamp_ns: 700 }, &FilterVerdict::default());
/// let restored = Recent::<FilterVerdict>::from_bytes(&recent.to_bytes()).expect("valid");
/// assert_eq!(restored.last(), StreamCursor { seq: 7, stamp_ns: 700 });
/// ```
#[derive(Debug, Clone)]
pub struct Recent<T> {
    messages: VecDeque<(StreamCursor, T)>,
}

impl<T> Default for Recent<T> {
    fn default() -> Self {
        Self { messages: VecDeque::new() }
    }
}

impl<T: Payload> Recent<T> {
    /// Adds a published message.
    pub fn note(&mut self, at: StreamCursor, message: &T) {
        if self.messages.len() >= T::SERVICE.qos.history {
            self.messages.pop_front();
        }
        self.messages.push_back((at, *message));
    }

    /// The last message; all zero before the first.
    #[must_use]
    pub fn last(&self) -> StreamCursor {
        self.messages.back().map_or_else(StreamCursor::default, |(at, _)| *at)
    }

    /// Publishes all of them.
    pub(crate) fn republish(&self, writer: &mut Writer<T>) -> Result<(), BusError> {
        self.messages.iter().try_for_each(|(at, message)| writer.send(at.seq, at.stamp_ns, message))
    }

    /// As bytes of a checkpoint. A message of zeros, the usual answer when nothing moves, takes one byte beside its cursor.
    #[must_use]
    pub fn to_bytes(&self) -> Vec<u8> {
        let mut bytes = Vec::with_capacity(self.messages.len() * (17 + size_of::<T>()));
        for (at, message) in &self.messages {
            bytes.extend([at.seq, at.stamp_ns].map(u64::to_le_bytes).as_flattened());
            let payload = bytemuck::bytes_of(message);
            let has_content = payload.iter().any(|byte| *byte != 0);
            bytes.push(u8::from(has_content));
            if has_content {
                bytes.extend(payload);
            }
        }
        bytes
    }

    /// From the bytes of a checkpoint; `None` for bytes that are cut or damaged.
    #[must_use]
    pub fn from_bytes(mut bytes: &[u8]) -> Option<Self> {
        let mut recent = Self::default();
        while !bytes.is_empty() {
            let (seq, rest) = bytes.split_first_chunk::<8>()?;
            let (stamp_ns, rest) = rest.split_first_chunk::<8>()?;
            let (has_content, rest) = rest.split_first()?;
            let (message, rest) = match has_content {
                0 => (T::zeroed(), rest),
                1 => {
                    let (payload, rest) = rest.split_at_checked(size_of::<T>())?;
                    (bytemuck::pod_read_unaligned(payload), rest)
                }
                _ => return None,
            };
            recent.note(StreamCursor { seq: u64::from_le_bytes(*seq), stamp_ns: u64::from_le_bytes(*stamp_ns) }, &message);
            bytes = rest;
        }
        Some(recent)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use messages::{FilterVerdict, Qos};

    #[test]
    fn as_many_as_the_history_holds_are_restored() {
        let mut recent = Recent::default();
        let most = Qos::STREAM.history as u64;
        for seq in 1..=most + 3 {
            let withheld = if seq % 3 == 0 { seq as u32 & 0xff } else { 0 };
            recent.note(StreamCursor { seq, stamp_ns: seq * 10 }, &FilterVerdict { withheld, ..FilterVerdict::default() });
        }
        let restored = Recent::<FilterVerdict>::from_bytes(&recent.to_bytes()).expect("valid");
        assert_eq!(restored.messages, recent.messages);
        assert_eq!((restored.messages.len() as u64, restored.messages[0].0.seq), (most, 4));
        assert_eq!(restored.last(), StreamCursor { seq: most + 3, stamp_ns: 10 * (most + 3) });
    }

    #[test]
    fn cut_and_damaged_bytes_are_refused() {
        let mut recent = Recent::default();
        recent.note(StreamCursor { seq: 1, stamp_ns: 2 }, &FilterVerdict { withheld: 5, ..FilterVerdict::default() });
        let bytes = recent.to_bytes();
        for end in 1..bytes.len() {
            assert!(Recent::<FilterVerdict>::from_bytes(&bytes[..end]).is_none(), "{end}");
        }
        let mut damaged = bytes;
        damaged[16] = 7;
        assert!(Recent::<FilterVerdict>::from_bytes(&damaged).is_none());
    }
}
