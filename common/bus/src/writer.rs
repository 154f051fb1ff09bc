//! One output of a process.

use std::cell::Cell;
use std::rc::Rc;

use iceoryx2::port::notifier::Notifier;
use iceoryx2::port::publisher::Publisher;
use iceoryx2::port::update_connections::UpdateConnections;
use iceoryx2::prelude::{PortFactory, ipc};
use messages::{Header, Kind, Payload};

use crate::broken::BusError;
use crate::fabric::{Opened, PubSub};
use crate::slot::{HeaderSlot, Slot};

/// Sends the messages of one service.
pub struct Writer<T: Payload> {
    ports: Rc<Ports<T>>,
    sent: Rc<Cell<u64>>,
    run: u64,
    readers: usize,
}

struct Ports<T: Payload> {
    publisher: Publisher<ipc::Service, Slot<T>, HeaderSlot>,
    notifier: Option<Notifier<ipc::Service>>,
    service: PubSub<T>,
}

/// Lets readers that joined since the last send have the history.
pub(crate) trait Refresh {
    fn refresh(&self);
}

impl<T: Payload> Refresh for Ports<T> {
    fn refresh(&self) {
        if let Err(error) = self.publisher.update_connections() {
            tracing::warn!("a reader of {} cannot be reached: {error:?}", T::SERVICE.name);
        }
    }
}

impl<T: Payload> Writer<T> {
    pub(crate) fn new(opened: Opened<T>, run: u64, sent: Rc<Cell<u64>>) -> Result<Self, BusError> {
        let name = T::SERVICE.name;
        let publisher = opened.data.publisher_builder().create().map_err(|error| BusError::broken(name, error))?;
        let notifier = match opened.wake {
            Some(wake) => Some(wake.notifier_builder().create().map_err(|error| BusError::broken(name, error))?),
            None => None,
        };
        Ok(Self { ports: Rc::new(Ports { publisher, notifier, service: opened.data }), sent, run, readers: 0 })
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

    /// Says that the stream ends after `seq`.
    ///
    /// # Errors
    /// When no memory can be loaned or a reader cannot be reached.
    pub fn end(&mut self, seq: u64, stamp_ns: u64) -> Result<(), BusError> {
        self.transmit(seq, stamp_ns, Kind::End, |_| ())
    }

    /// Whether a reader has joined since this was last asked.
    pub fn joined(&mut self) -> bool {
        let readers = self.ports.service.dynamic_config().number_of_subscribers();
        let joined = readers > self.readers;
        self.readers = readers;
        joined
    }

    pub(crate) fn refresh(&self) -> Rc<dyn Refresh> {
        self.ports.clone()
    }

    fn transmit(&mut self, seq: u64, stamp_ns: u64, kind: Kind, fill: impl FnOnce(&mut T)) -> Result<(), BusError> {
        let name = T::SERVICE.name;
        let mut sample = self.ports.publisher.loan_uninit().map_err(|error| BusError::refused("cannot loan for", name, error))?;
        let zeroed = sample.payload_mut().write(Slot(bytemuck::Zeroable::zeroed()));
        fill(&mut zeroed.0);
        let crc32 = crc32fast::hash(bytemuck::bytes_of(&zeroed.0));
        *sample.user_header_mut() = HeaderSlot(Header { run: self.run, seq, stamp_ns, kind: kind as u32, crc32 });
        // SAFETY: the payload was written whole above.
        #[expect(unsafe_code, reason = "filled in place, so that large payloads are not copied over the stack")]
        let sample = unsafe { sample.assume_init() };
        sample.send().map_err(|error| BusError::refused("cannot send on", name, error))?;
        if let Some(notifier) = &self.ports.notifier
            && let Err(error) = notifier.notify()
        {
            tracing::debug!("a reader of {name} was not woken: {error:?}");
        }
        self.sent.set(self.sent.get() + 1);
        Ok(())
    }
}
