//! One output of a process.

use std::cell::Cell;
use std::rc::Rc;

use messages::{Header, Kind, Payload};

use crate::connections::Connections;
use crate::error::BusError;
use crate::fabric::{Opened, PubSub};
use crate::outlet::{Outlet, Refresh};
use crate::slot::{HeaderSlot, Slot};
use crate::stream::checksum;

/// Sends the messages of one service.
///
/// ```
/// use stillmap_bus::{Domain, Ports};
/// use messages::{Pose, SonarScan};
///
/// let domain = Domain::open(&format!("example-writer-{}", std::process::id()), 1.0)?;
/// let membership = domain.membership_for("example", 0, "settings.toml".as_ref());
/// let mut ports = Ports::join(&membership)?;
/// let mut driver = ports.writer::<SonarScan>()?;
/// // Numbers start from 1; stamps are sensor time and never decrease.
/// driver.send(1, 1_000, &SonarScan::new(Pose::default(), &[], false))?;
/// driver.end(1, 1_000)?;
/// # drop((driver, ports));
/// domain.close()?;
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct Writer<T: Payload> {
    outlet: Rc<Outlet<Slot<T>, HeaderSlot>>,
    run: u64,
}

impl<T: Payload> Writer<T> {
    pub(crate) fn new(opened: Opened<PubSub<T>>, run: u64, sent: Rc<Cell<u64>>) -> Result<Self, BusError> {
        let name = T::SERVICE.name;
        let connections = Connections::new(name);
        let builder = opened.data.publisher_builder().set_degradation_handler(connections.on_failure());
        let publisher = builder.create().map_err(|error| BusError::broken(name, error))?;
        Ok(Self { outlet: Rc::new(Outlet::new(connections, publisher, opened, sent)?), run })
    }

    /// Sends a copy of `payload`.
    ///
    /// # Errors
    /// When no memory can be loaned or a reader cannot be reached.
    pub fn send(&mut self, seq: u64, stamp_ns: u64, payload: &T) -> Result<(), BusError> {
        self.transmit(seq, stamp_ns, Kind::Data, |place| *place = *payload)
    }

    /// Sends a payload that `fill` writes in place, into memory that is all zero.
    ///
    /// # Errors
    /// When no memory can be loaned or a reader cannot be reached.
    pub fn send_with(&mut self, seq: u64, stamp_ns: u64, fill: impl FnOnce(&mut T)) -> Result<(), BusError> {
        self.transmit(seq, stamp_ns, Kind::Data, fill)
    }

    /// Says that message `seq` does not come because a newer one waited: readers do not count it as lost.
    ///
    /// # Errors
    /// When no memory can be loaned or a reader cannot be reached.
    pub fn skip(&mut self, seq: u64, stamp_ns: u64) -> Result<(), BusError> {
        self.transmit(seq, stamp_ns, Kind::Skipped, |_| ())
    }

    /// Says that the stream ends after `seq`.
    ///
    /// # Errors
    /// When no memory can be loaned or a reader cannot be reached.
    pub fn end(&mut self, seq: u64, stamp_ns: u64) -> Result<(), BusError> {
        self.transmit(seq, stamp_ns, Kind::End, |_| ())
    }

    /// Whether a reader has joined since this was last asked.
    pub fn joined(&mut self) -> bool {
        self.outlet.joined()
    }

    pub(crate) fn refresh(&self) -> Rc<dyn Refresh> {
        self.outlet.clone()
    }

    fn transmit(&mut self, seq: u64, stamp_ns: u64, kind: Kind, fill: impl FnOnce(&mut T)) -> Result<(), BusError> {
        let name = T::SERVICE.name;
        let mut sample = self.outlet.publisher.loan_uninit().map_err(|error| BusError::refused("cannot loan for", name, error))?;
        let zeroed = sample.payload_mut().write(Slot(bytemuck::Zeroable::zeroed()));
        fill(&mut zeroed.0);
        let header = Header { run: self.run, seq, stamp_ns, kind: kind as u32, crc32: 0 };
        let crc32 = checksum(&header, bytemuck::bytes_of(&zeroed.0));
        *sample.user_header_mut() = HeaderSlot(Header { crc32, ..header });
        // SAFETY: the payload was written whole above.
        #[expect(unsafe_code, reason = "filled in place, so that large payloads are not copied over the stack")]
        let sample = unsafe { sample.assume_init() };
        sample.send().map_err(|error| BusError::refused("cannot send on", name, error))?;
        self.outlet.has_sent()
    }
}
