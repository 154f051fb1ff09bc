//! The declaration of a service on the bus, and the traits that bind it to its payload.

use crate::Layout;
use crate::delivery::{Qos, Replay};

/// A service on the bus: its name, its delivery, and what the tools do with it.
///
/// All of them are declared in `registry.rs`.
///
/// ```
/// use stillmap_messages::{Payload, SonarScan};
///
/// let service = SonarScan::SERVICE;
/// assert_eq!((service.name, service.version), ("robot/scan", 2));
/// assert!(service.sequenced && service.injectable);
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Service {
    /// Name on the bus, for example `robot/scan`.
    pub name: &'static str,
    /// Version of the payload's meaning; part of the contract of the service, so that two versions never meet.
    pub version: u32,
    /// What it carries, in one or two sentences.
    pub doc: &'static str,
    /// The built-in processes that send it. A command may send it in place of them.
    pub from: &'static [&'static str],
    /// The built-in processes that read it; `command` is the command, when it looks at a running deployment.
    pub to: &'static [&'static str],
    /// How many messages it keeps and how many processes may use it.
    pub qos: Qos,
    /// Whether a send wakes the readers. Without it a reader reads when it has another reason to run.
    pub wakes: bool,
    /// Whether a reader follows one numbered stream: it drops what it has already received, counts what is missing, and refuses
    /// stamps that decrease. Otherwise every message stands for itself: there are several senders, or only the newest matters.
    pub sequenced: bool,
    /// Whether and how the recorder writes it to the log.
    pub recorded: Recorded,
    /// How playback sends it from a log; `None` where it is not played.
    pub replay: Option<Replay>,
    /// Whether it can go through the injector, which loses, delays and damages messages on purpose.
    pub injectable: bool,
    /// Whether the viewer reads it: it is a channel for Foxglove, and the page draws what it knows of it.
    pub shown: bool,
}

impl Service {
    /// The attribute `contract` of the service on the bus, for a payload whose layout has this hash.
    ///
    /// ```
    /// use stillmap_messages::{Layout, Payload, SonarScan};
    ///
    /// let contract = SonarScan::SERVICE.contract(SonarScan::HASH);
    /// assert!(contract.starts_with("version 2 layout "), "{contract}");
    /// ```
    #[must_use]
    pub fn contract(&self, layout: u64) -> String {
        format!("version {} layout {layout:016x}", self.version)
    }
}

/// Whether and how the recorder writes a service to the log.
///
/// ```
/// use stillmap_messages::{Heartbeat, Payload, Recorded, SonarScan};
///
/// assert_eq!(SonarScan::SERVICE.recorded, Recorded::AtStamp);
/// assert_eq!(Heartbeat::SERVICE.recorded, Recorded::AsReport);
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Recorded {
    /// Not at all.
    No,
    /// At its stamp, which is sensor time.
    AtStamp,
    /// Where it arrives among the sensor messages: it is about the deployment, and its stamp is not sensor time.
    AsReport,
}

/// The payload of a service.
///
/// Implemented by the registry for each of its entries, and by nothing else.
///
/// ```
/// use stillmap_messages::{Payload, PlaybackControl};
///
/// let control = PlaybackControl { speed: 1000.0, ..PlaybackControl::default() };
/// assert_eq!(control.validate().unwrap_err().to_string(), "speed is 1000, expected 0.1 to 100");
/// ```
pub trait Payload: bytemuck::Pod + Layout + postcard_schema::Schema + Default + core::fmt::Debug {
    /// The service that carries this payload.
    const SERVICE: Service;

    /// Checks what the type cannot express: counts within arrays, finite numbers, ranges.
    ///
    /// # Errors
    /// The first field that is out of range, with what was found and expected.
    fn validate(&self) -> Result<(), Invalid>;
}

/// A service that carries pictures: a slice of bytes under a [`FrameHeader`](crate::FrameHeader).
///
/// ```
/// use stillmap_messages::{CameraFrame, MAX_FRAME_BYTES, Pictures};
///
/// assert_eq!((CameraFrame::SERVICE.name, CameraFrame::MAX_BYTES), ("camera/frame", MAX_FRAME_BYTES));
/// ```
pub trait Pictures: core::fmt::Debug + 'static {
    /// The service.
    const SERVICE: Service;
    /// Largest picture on it, bytes.
    const MAX_BYTES: usize;
}

/// Work to be done for every service of the registry: see [`visit_services`](crate::visit_services).
///
/// ```
/// use stillmap_messages::{Payload, Pictures, ServiceVisitor, visit_services};
///
/// struct Names(Vec<&'static str>);
///
/// impl ServiceVisitor for Names {
///     type Error = core::convert::Infallible;
///
///     fn message<T: Payload>(&mut self) -> Result<(), Self::Error> {
///         self.0.push(T::SERVICE.name);
///         Ok(())
///     }
///
///     fn pictures<P: Pictures>(&mut self) -> Result<(), Self::Error> {
///         self.0.push(P::SERVICE.name);
///         Ok(())
///     }
/// }
///
/// let mut names = Names(Vec::new());
/// let Ok(()) = visit_services(&mut names);
/// assert!(names.0.contains(&"robot/scan") && names.0.contains(&"camera/frame"));
/// ```
pub trait ServiceVisitor {
    /// What ends the visit.
    type Error;

    /// A service that carries messages.
    ///
    /// # Errors
    /// Anything that ends the visit.
    fn message<T: Payload>(&mut self) -> Result<(), Self::Error>;

    /// A service that carries pictures.
    ///
    /// # Errors
    /// Anything that ends the visit.
    fn pictures<P: Pictures>(&mut self) -> Result<(), Self::Error>;
}

/// A payload with a number that is out of range.
///
/// ```
/// use stillmap_messages::{Payload, Pose, SonarReading, SonarScan};
///
/// let reading = SonarReading::new(0, Pose::default(), 12.0, true);
/// let invalid = SonarScan::new(Pose::default(), &[reading], false).validate().unwrap_err();
/// assert_eq!(invalid.field, "readings.range_m");
/// assert_eq!(invalid.to_string(), "readings.range_m is 12, expected 0 to 10 m");
/// ```
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("{field} is {found}, expected {expected}")]
pub struct Invalid {
    /// The field, as a path within the payload.
    pub field: &'static str,
    /// Its value.
    pub found: f64,
    /// The values that are allowed.
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
