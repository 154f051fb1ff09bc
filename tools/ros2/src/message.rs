//! Messages of a bag as they are stored.

/// A topic of a bag.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Topic {
    pub(crate) name: String,
    /// For example `sensor_msgs/msg/Range`.
    pub(crate) type_name: String,
    /// For example `cdr`.
    pub(crate) encoding: String,
}

/// A message of a bag.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Message<'a> {
    pub(crate) topic: &'a Topic,
    pub(crate) received_ns: u64,
    pub(crate) data: &'a [u8],
}
