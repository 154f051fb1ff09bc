//! Names, versions and quality of service, and the trait that binds them to a payload.

use crate::Layout;

/// How many messages a service keeps and how many processes may use it.
///
/// Every count holds at least two spare places: tools join a running deployment, and a killed process leaves its place
/// taken until the supervisor has cleaned up.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Qos {
    /// Messages that a late or restarted subscriber still receives.
    pub history: usize,
    /// Messages that wait for a subscriber before the oldest is dropped.
    pub buffer: usize,
    /// Most processes that publish at once.
    pub publishers: usize,
    /// Most processes that subscribe at once.
    pub subscribers: usize,
}

impl Qos {
    /// One producer; nothing may be lost: history for a restart, and a buffer above history and lockstep window together.
    pub const STREAM: Qos = Qos { history: 512, buffer: 1024, publishers: 3, subscribers: 12 };
    /// One producer; the newest value matters, a reader that is late sees the last few.
    pub const NEWEST: Qos = Qos { history: 1, buffer: 4, publishers: 3, subscribers: 12 };
    /// Every process publishes a few values a second.
    pub const REPORTS: Qos = Qos { history: 1, buffer: 16, publishers: 32, subscribers: 12 };
}

/// A service on the bus: what it is called and how it delivers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Service {
    /// Name on the bus, for example `robot/scan`.
    pub name: &'static str,
    /// Version of the payload's meaning; part of the type name on the bus, so that versions never meet.
    pub version: u32,
    /// How it delivers.
    pub qos: Qos,
    /// Whether a send wakes the readers; without it a reader looks when it has its own reason to.
    pub wakes: bool,
    /// Whether a reader follows one numbered stream: drops what it has had, counts what is missing, refuses stamps that run
    /// backwards. Otherwise every message stands for itself (several senders, or newest wins).
    pub sequenced: bool,
}

/// What travels on a service.
pub trait Payload: bytemuck::Pod + Layout + core::fmt::Debug {
    /// The service that carries this payload.
    const SERVICE: Service;

    /// Checks what the type cannot say: counts within arrays, numbers finite, ranges.
    ///
    /// # Errors
    /// The first field that is out of range, with what was found and expected.
    fn validate(&self) -> Result<(), Invalid>;
}

/// A payload whose numbers cannot be meant.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("{field} is {found}, expected {expected}")]
pub struct Invalid {
    /// The field, as a path within the payload.
    pub field: &'static str,
    /// Its value.
    pub found: f64,
    /// What it may be.
    pub expected: &'static str,
}

pub(crate) fn finite(field: &'static str, value: f64) -> Result<(), Invalid> {
    within(field, value, f64::MIN, f64::MAX, "a finite number")
}

pub(crate) fn within(field: &'static str, value: f64, low: f64, high: f64, expected: &'static str) -> Result<(), Invalid> {
    if value >= low && value <= high { Ok(()) } else { Err(Invalid { field, found: value, expected }) }
}

pub(crate) fn at_most(field: &'static str, count: u32, most: usize, expected: &'static str) -> Result<(), Invalid> {
    within(field, f64::from(count), 0.0, most as f64, expected)
}
