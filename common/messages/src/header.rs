//! The header of every message.

use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

use crate::layout::plain;
use crate::numbered::numbered;

plain! {
    /// The header of every payload: the run, and the position of the message in its stream.
    ///
    /// ```
    /// use stillmap_messages::{Header, Kind};
    ///
    /// let header = Header { run: 7, seq: 1, stamp_ns: 1_700_000_000_000_000_000, kind: Kind::Data as u32, crc32: 0 };
    /// assert_eq!(size_of_val(&header), 32);
    /// ```
    pub struct Header {
        /// Identity of the run. Readers refuse messages of another run.
        pub run: u64,
        /// Sequence number in the source stream, from 1. An answer has the number of the message that it answers.
        pub seq: u64,
        /// Sensor time of what the payload reports, ns.
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
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, Schema)]
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

numbered! {
    /// The kind of a message.
    ///
    /// ```
    /// use stillmap_messages::Kind;
    ///
    /// assert_eq!(Kind::from_number(1), Some(Kind::End));
    /// assert_eq!(Kind::from_number(4), None);
    /// ```
    pub enum Kind {
        /// A payload.
        Data = 0,
        /// The stream ends after `seq`; the payload is all zero.
        End = 1,
        /// Message `seq` was dropped on purpose: a consumer in lockstep does not wait for it. The payload is all zero.
        Gap = 2,
        /// The sender left message `seq` out because a newer one waited: readers do not count it as lost. The payload is all zero.
        Skipped = 3,
    }
}
