//! Messages as they are in shared memory, unchecked: what stands between a publisher and its readers takes and gives them.

use std::cell::Cell;
use std::rc::Rc;

use iceoryx2::port::listener::Listener;
use iceoryx2::port::subscriber::Subscriber;
use iceoryx2::prelude::ipc;
use messages::{Header, Kind, Payload};

use crate::connections::Connections;
use crate::error::BusError;
use crate::fabric::{Opened, PubSub, listener};
use crate::outlet::{Outlet, Refresh};
use crate::slot::{HeaderSlot, Slot};
use crate::stream::checksum;

/// A message with its header, whatever they say.
///
/// ```
/// use stillmap_bus::{Claim, Ports};
/// use messages::SonarScan;
///
/// let claim = Claim::take(&format!("example-raw-{}", std::process::id()), 1.0)?;
/// let run = claim.new_run();
/// let domain = claim.open(run, &["robot/scan"])?;
/// let mut ports = Ports::join(&domain.membership_for("injector", 0, "settings.toml".as_ref()))?;
/// let tap = ports.tap::<SonarScan>()?;
/// let injection = ports.injection::<SonarScan>()?;
/// let mut driver = ports.writer::<SonarScan>()?;
/// driver.send(1, 1_000, &SonarScan::default())?;
///
/// let message = tap.take()?.expect("a scan waits");
/// assert_eq!((message.seq(), message.stamp_ns(), message.is_end()), (1, 1_000, false));
/// # let _ = &injection;
/// # drop((tap, injection, driver, ports));
/// domain.close()?;
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone, Copy)]
pub struct Raw<T: Payload> {
    header: Header,
    payload: T,
}

/// Takes what publishers send on a service that does not go straight to its readers.
///
/// ```
/// use stillmap_bus::{Claim, Ports};
/// use messages::SonarScan;
///
/// let claim = Claim::take(&format!("example-tap-{}", std::process::id()), 1.0)?;
/// let run = claim.new_run();
/// let domain = claim.open(run, &["robot/scan"])?;
/// let mut ports = Ports::join(&domain.membership_for("injector", 0, "settings.toml".as_ref()))?;
/// let tap = ports.tap::<SonarScan>()?;
/// let injection = ports.injection::<SonarScan>()?;
/// let mut driver = ports.writer::<SonarScan>()?;
/// driver.send(1, 1_000, &SonarScan::default())?;
///
/// let message = tap.take()?.expect("a scan waits");
/// // It has not reached the readers of `robot/scan`.
/// assert_eq!(message.seq(), 1);
/// # let _ = &injection;
/// # drop((tap, injection, driver, ports));
/// domain.close()?;
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct Tap<T: Payload> {
    subscriber: Subscriber<ipc::Service, Slot<T>, HeaderSlot>,
    listener: Option<Rc<Listener<ipc::Service>>>,
    connections: Connections,
    service: PubSub<T>,
}

/// Gives messages to the readers of a service as if their publisher had.
///
/// ```
/// use stillmap_bus::{Claim, Ports};
/// use messages::SonarScan;
///
/// let claim = Claim::take(&format!("example-injection-{}", std::process::id()), 1.0)?;
/// let run = claim.new_run();
/// let domain = claim.open(run, &["robot/scan"])?;
/// let mut ports = Ports::join(&domain.membership_for("injector", 0, "settings.toml".as_ref()))?;
/// let tap = ports.tap::<SonarScan>()?;
/// let injection = ports.injection::<SonarScan>()?;
/// let mut driver = ports.writer::<SonarScan>()?;
/// driver.send(1, 1_000, &SonarScan::default())?;
///
/// let message = tap.take()?.expect("a scan waits");
/// let mut scans = ports.reader::<SonarScan>()?;
/// injection.send(&message)?;
/// assert!(scans.take()?.is_some());
/// # drop(scans);
/// # drop((tap, injection, driver, ports));
/// domain.close()?;
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct Injection<T: Payload> {
    outlet: Rc<Outlet<Slot<T>, HeaderSlot>>,
}

impl<T: Payload> Raw<T> {
    /// Its place in the source stream.
    #[must_use]
    pub fn seq(&self) -> u64 {
        self.header.seq
    }

    /// Sensor time, ns.
    #[must_use]
    pub fn stamp_ns(&self) -> u64 {
        self.header.stamp_ns
    }

    /// Whether it says that the stream ends.
    #[must_use]
    pub fn is_end(&self) -> bool {
        self.header.kind == Kind::End as u32
    }

    /// Turns over a bit of the payload, counted around its end; the checksum stays that of what it was.
    pub fn turn_over(&mut self, bit: u64) {
        let bytes = bytemuck::bytes_of_mut(&mut self.payload);
        let at = bit % (8 * bytes.len() as u64).max(1);
        if let Some(byte) = bytes.get_mut((at / 8) as usize) {
            *byte ^= 1 << (at % 8);
        }
    }

    /// Puts its sensor time forward, as a publisher whose clock is set would; a wrong checksum stays wrong.
    pub fn put_forward(&mut self, by_ns: u64) {
        let damage = self.header.crc32 ^ self.checksum();
        self.header.stamp_ns = self.header.stamp_ns.saturating_add(by_ns);
        self.header.crc32 = damage ^ self.checksum();
    }

    /// Leaves only the word that it does not come.
    pub fn leave_gap(&mut self) {
        self.payload = T::zeroed();
        self.header.kind = Kind::Gap as u32;
        self.header.crc32 = self.checksum();
    }

    fn checksum(&self) -> u32 {
        checksum(&Header { crc32: 0, ..self.header }, bytemuck::bytes_of(&self.payload))
    }
}

impl<T: Payload> Tap<T> {
    pub(crate) fn new(opened: Opened<PubSub<T>>) -> Result<Self, BusError> {
        let connections = Connections::new(T::SERVICE.name);
        let builder = opened.data.subscriber_builder().set_degradation_handler(connections.on_failure());
        let subscriber = builder.create().map_err(|error| BusError::broken(T::SERVICE.name, error))?;
        Ok(Self { subscriber, listener: listener(&opened)?, connections, service: opened.data })
    }

    /// The next message, if one waits.
    ///
    /// # Errors
    /// When the connection to a sender cannot be made.
    pub fn take(&self) -> Result<Option<Raw<T>>, BusError> {
        let received = self.subscriber.receive().map_err(|error| BusError::refused("cannot receive from", T::SERVICE.name, error))?;
        self.connections.check(&self.service)?;
        Ok(received.map(|sample| Raw { header: sample.user_header().0, payload: sample.payload().0 }))
    }

    pub(crate) fn listener(&self) -> Option<Rc<Listener<ipc::Service>>> {
        self.listener.clone()
    }
}

impl<T: Payload> Injection<T> {
    pub(crate) fn new(opened: Opened<PubSub<T>>, sent: Rc<Cell<u64>>) -> Result<Self, BusError> {
        let connections = Connections::new(T::SERVICE.name);
        let builder = opened.data.publisher_builder().set_degradation_handler(connections.on_failure());
        let publisher = builder.create().map_err(|error| BusError::broken(T::SERVICE.name, error))?;
        Ok(Self { outlet: Rc::new(Outlet::new(connections, publisher, opened, sent)?) })
    }

    /// Sends a message as it is.
    ///
    /// # Errors
    /// When no memory can be loaned or a reader cannot be reached.
    pub fn send(&self, message: &Raw<T>) -> Result<(), BusError> {
        let name = T::SERVICE.name;
        let sample = self.outlet.publisher.loan_uninit().map_err(|error| BusError::refused("cannot loan for", name, error))?;
        let mut sample = sample.write_payload(Slot(message.payload));
        *sample.user_header_mut() = HeaderSlot(message.header);
        sample.send().map_err(|error| BusError::refused("cannot send on", name, error))?;
        self.outlet.has_sent()
    }

    pub(crate) fn refresh(&self) -> Rc<dyn Refresh> {
        self.outlet.clone()
    }
}
