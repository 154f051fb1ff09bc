//! The header of every message.

use crate::layout::plain;

plain! {
    /// Stands before every payload: where in its stream a message is, and of which run.
    pub struct Header {
        /// The run of the deployment; messages of an earlier run are never mistaken for this one's.
        pub run: u64,
        /// Place in the source stream, from 1. A service that answers a stream uses the number it answers.
        pub seq: u64,
        /// Sensor time of what the payload tells.
        pub stamp_ns: u64,
        /// [`Kind`] as a number.
        pub kind: u32,
        /// CRC-32 of the message: the header, in which this field is 0, and the payload's bytes.
        pub crc32: u32,
    }
}

/// How far a stream has been received, sent or processed: the last message of it.
///
/// ```
/// use stillmap_messages::StreamCursor;
///
/// let mut cursor = StreamCursor::default();
/// cursor.advance(StreamCursor { seq: 7, stamp_ns: 700 });
/// cursor.advance(StreamCursor { seq: 6, stamp_ns: 600 });
/// assert_eq!(cursor, StreamCursor { seq: 7, stamp_ns: 700 });
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct StreamCursor {
    /// Its sequence number; 0 before the first message.
    pub seq: u64,
    /// Its stamp, ns of sensor time.
    pub stamp_ns: u64,
}

impl StreamCursor {
    /// Moves to a later message; number and stamp never go back.
    pub fn advance(&mut self, to: Self) {
        *self = Self { seq: self.seq.max(to.seq), stamp_ns: self.stamp_ns.max(to.stamp_ns) };
    }
}

/// What a message is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u32)]
pub enum Kind {
    /// A payload.
    Data = 0,
    /// The stream ends after `seq`; the payload is all zero.
    End = 1,
    /// Message `seq` does not come: who waits for it in lockstep need not. The payload is all zero.
    Gap = 2,
}

impl Kind {
    /// The kind a number stands for, if any.
    #[must_use]
    pub fn from_number(number: u32) -> Option<Self> {
        match number {
            0 => Some(Self::Data),
            1 => Some(Self::End),
            2 => Some(Self::Gap),
            _ => None,
        }
    }
}
