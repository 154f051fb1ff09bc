//! The messages of a bag on their way to their reader, and what of them is damaged.

use crate::damages::Damages;
use crate::error::BagError;
use crate::message::{Message, Topic};

/// What the messages of a bag are for, and what of them cannot be read.
pub(crate) struct Visit<'a> {
    wants: &'a dyn Fn(&Topic) -> bool,
    each: &'a mut dyn FnMut(Message<'_>) -> Result<(), BagError>,
    damages: Damages,
    /// The first damage, while no message has been found.
    first_error: Option<BagError>,
    has_messages: bool,
}

impl<'a> Visit<'a> {
    pub(crate) fn new(wants: &'a dyn Fn(&Topic) -> bool, each: &'a mut dyn FnMut(Message<'_>) -> Result<(), BagError>) -> Self {
        Self { wants, each, damages: Damages::default(), first_error: None, has_messages: false }
    }

    /// What could not be read, or the first damage of a bag without any message.
    pub(crate) fn end(self) -> Result<Damages, BagError> {
        self.first_error.map_or(Ok(self.damages), Err)
    }

    pub(crate) fn wants(&self, topic: &Topic) -> bool {
        (self.wants)(topic)
    }

    /// Takes note of what cannot be read. A bag without any message is none.
    pub(crate) fn damaged(&mut self, error: BagError) {
        self.damages.add(error.to_string());
        if !self.has_messages {
            self.first_error.get_or_insert(error);
        }
    }

    /// A message has been found.
    pub(crate) fn found(&mut self) {
        self.has_messages = true;
        self.first_error = None;
    }

    /// Passes on a message by its number in its topic or, in SQLite, its table. ROS counts nanoseconds in 63 bits.
    pub(crate) fn message(&mut self, topic: &Topic, number: i64, received_ns: i128, stored: &[u8]) -> Result<(), BagError> {
        match i64::try_from(received_ns).map(u64::try_from) {
            Ok(Ok(received_ns)) => (self.each)(Message { topic, received_ns, stored }),
            Ok(Err(_)) | Err(_) => {
                let problem = format!("message {number} has the time {received_ns} ns, expected 0 to {}", i64::MAX);
                self.damaged(BagError::Topic { topic: topic.name.clone(), problem });
                Ok(())
            }
        }
    }
}
