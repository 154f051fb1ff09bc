//! What was said last, kept between incarnations.

use std::collections::VecDeque;

use messages::Payload;

use crate::error::BusError;
use crate::writer::Writer;

/// The last messages that a process sent on a stream.
///
/// A stream's history dies with its sender. Who reads the stream and dies with it goes on from a checkpoint that may lie
/// before that of the sender: what lies between was said, and is computed by nobody again. So a sender keeps it and says it
/// again when it is back; who has had it drops it.
#[derive(Debug, Clone)]
pub struct Recent<T> {
    messages: VecDeque<(u64, u64, T)>,
}

impl<T> Default for Recent<T> {
    fn default() -> Self {
        Self { messages: VecDeque::new() }
    }
}

impl<T: Payload> Recent<T> {
    /// Takes note of a message by its number and stamp; as many are kept as the stream's history holds.
    pub fn note(&mut self, seq: u64, stamp_ns: u64, message: &T) {
        if self.messages.len() >= T::SERVICE.qos.history {
            self.messages.pop_front();
        }
        self.messages.push_back((seq, stamp_ns, *message));
    }

    /// Says all of it again.
    ///
    /// # Errors
    /// When the bus refuses.
    pub fn republish(&self, writer: &mut Writer<T>) -> Result<(), BusError> {
        self.messages.iter().try_for_each(|(seq, stamp_ns, message)| writer.send(*seq, *stamp_ns, message))
    }

    /// For the next incarnation. A message of zeros, the usual answer when nothing moves, takes one byte.
    #[must_use]
    pub fn to_bytes(&self) -> Vec<u8> {
        let mut bytes = Vec::with_capacity(self.messages.len() * (17 + size_of::<T>()));
        for (seq, stamp_ns, message) in &self.messages {
            bytes.extend([*seq, *stamp_ns].map(u64::to_le_bytes).as_flattened());
            let payload = bytemuck::bytes_of(message);
            let says_something = payload.iter().any(|byte| *byte != 0);
            bytes.push(u8::from(says_something));
            if says_something {
                bytes.extend(payload);
            }
        }
        bytes
    }

    /// From an earlier incarnation; `None` for bytes that are cut or no messages.
    #[must_use]
    pub fn from_bytes(mut bytes: &[u8]) -> Option<Self> {
        let mut recent = Self::default();
        while !bytes.is_empty() {
            let (seq, rest) = bytes.split_first_chunk::<8>()?;
            let (stamp_ns, rest) = rest.split_first_chunk::<8>()?;
            let (says_something, rest) = rest.split_first()?;
            let (message, rest) = match says_something {
                0 => (T::zeroed(), rest),
                1 => {
                    let (payload, rest) = rest.split_at_checked(size_of::<T>())?;
                    (bytemuck::pod_read_unaligned(payload), rest)
                }
                _ => return None,
            };
            recent.note(u64::from_le_bytes(*seq), u64::from_le_bytes(*stamp_ns), &message);
            bytes = rest;
        }
        Some(recent)
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "tests fail by panicking")]
    use super::*;
    use messages::{FilterVerdict, Qos};

    #[test]
    fn as_many_as_the_history_holds_come_back_as_they_were() {
        let mut recent = Recent::default();
        let most = Qos::STREAM.history as u64;
        for seq in 1..=most + 3 {
            let withheld = if seq % 3 == 0 { seq as u32 & 0xff } else { 0 };
            recent.note(seq, seq * 10, &FilterVerdict { withheld, ..FilterVerdict::default() });
        }
        let back = Recent::<FilterVerdict>::from_bytes(&recent.to_bytes()).unwrap();
        assert_eq!(back.messages, recent.messages);
        assert_eq!((back.messages.len() as u64, back.messages[0].0), (most, 4));
    }

    #[test]
    fn what_is_cut_or_foreign_is_nothing() {
        let mut recent = Recent::default();
        recent.note(1, 2, &FilterVerdict { withheld: 5, ..FilterVerdict::default() });
        let bytes = recent.to_bytes();
        for end in 1..bytes.len() {
            assert!(Recent::<FilterVerdict>::from_bytes(&bytes[..end]).is_none(), "{end}");
        }
        let mut foreign = bytes;
        foreign[16] = 7;
        assert!(Recent::<FilterVerdict>::from_bytes(&foreign).is_none());
    }
}
