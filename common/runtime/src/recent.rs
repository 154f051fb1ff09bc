//! The last answers of a process, which are part of its state.

use std::collections::VecDeque;

use bus::{BusError, Writer};
use messages::{Payload, StreamCursor};
use postcard_schema::Schema;
use postcard_schema::schema::{DataModelType, NamedType};
use serde::de::Error;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

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
/// let restored: Recent<FilterVerdict> = state::decode(&state::encode(&recent, Vec::new()))?;
/// assert_eq!(restored.last(), StreamCursor { seq: 7, stamp_ns: 700 });
/// # Ok::<(), state::DecodeError>(())
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
}

/// A message of a checkpoint: a message of zeros, the usual answer when nothing moves, takes one byte beside its cursor.
#[derive(Serialize, Deserialize)]
struct SavedMessage<'a>(StreamCursor, #[serde(borrow)] Option<&'a [u8]>);

impl<T: Payload> Serialize for Recent<T> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_seq(self.messages.iter().map(|(at, message)| {
            let payload = bytemuck::bytes_of(message);
            SavedMessage(*at, payload.iter().any(|byte| *byte != 0).then_some(payload))
        }))
    }
}

impl<'de, T: Payload> Deserialize<'de> for Recent<T> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let mut recent = Self::default();
        for SavedMessage(at, payload) in Vec::<SavedMessage<'de>>::deserialize(deserializer)? {
            let message = match payload {
                None => T::zeroed(),
                Some(bytes) => bytemuck::try_pod_read_unaligned(bytes).map_err(|_| D::Error::invalid_length(bytes.len(), &"a payload"))?,
            };
            recent.note(at, &message);
        }
        Ok(recent)
    }
}

impl<T: Payload> Schema for Recent<T> {
    const SCHEMA: &'static NamedType = &NamedType { name: "Recent", ty: &DataModelType::Seq(<(StreamCursor, Option<T>)>::SCHEMA) };
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
        let restored: Recent<FilterVerdict> = state::decode(&state::encode(&recent, Vec::new())).expect("valid");
        assert_eq!(restored.messages, recent.messages);
        assert_eq!((restored.messages.len() as u64, restored.messages[0].0.seq), (most, 4));
        assert_eq!(restored.last(), StreamCursor { seq: most + 3, stamp_ns: 10 * (most + 3) });
    }

    #[test]
    fn cut_and_damaged_bytes_are_refused() {
        let mut recent = Recent::default();
        recent.note(StreamCursor { seq: 1, stamp_ns: 2 }, &FilterVerdict { withheld: 5, ..FilterVerdict::default() });
        let bytes = state::encode(&recent, Vec::new());
        for end in 0..bytes.len() {
            assert!(state::decode::<Recent<FilterVerdict>>(&bytes[..end]).is_err(), "{end}");
        }
        // Version, number of messages, cursor; then whether there is content.
        let mut damaged = bytes;
        damaged[11] = 7;
        assert!(state::decode::<Recent<FilterVerdict>>(&damaged).is_err());
    }
}
