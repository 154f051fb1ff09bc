//! The sender's side of one service: its port, its event and its count.

use std::cell::{Cell, RefCell};
use std::fmt::Debug;
use std::rc::Rc;

use iceoryx2::port::notifier::Notifier;
use iceoryx2::port::publisher::Publisher;
use iceoryx2::port::update_connections::UpdateConnections;
use iceoryx2::prelude::{CallbackProgression, IceoryxSend, PortFactory, ZeroCopySend, ipc};
use iceoryx2::service::port_factory::publish_subscribe;

use crate::connections::Connections;
use crate::error::BusError;
use crate::fabric::Opened;

/// Lets readers that joined since the last send have the history.
pub(crate) trait Refresh {
    fn refresh(&self);
}

/// A port that sends payloads `P` under headers `H`.
pub(crate) struct Outlet<P: Debug + IceoryxSend + ?Sized + 'static, H: Debug + ZeroCopySend + 'static> {
    pub(crate) publisher: Publisher<ipc::Service, P, H>,
    notifier: Option<Notifier<ipc::Service>>,
    service: publish_subscribe::PortFactory<ipc::Service, P, H>,
    connections: Connections,
    name: &'static str,
    sent: Rc<Cell<u64>>,
    /// The readers that there were when this was last asked.
    known: RefCell<Vec<u128>>,
}

impl<P: Debug + IceoryxSend + ?Sized, H: Debug + ZeroCopySend> Refresh for Outlet<P, H> {
    fn refresh(&self) {
        if let Err(error) = self.publisher.update_connections() {
            tracing::warn!("a reader of {} cannot be reached: {error:?}", self.name);
        }
    }
}

impl<P: Debug + IceoryxSend + ?Sized, H: Debug + ZeroCopySend> Outlet<P, H> {
    pub(crate) fn new(
        connections: Connections,
        publisher: Publisher<ipc::Service, P, H>,
        opened: Opened<publish_subscribe::PortFactory<ipc::Service, P, H>>,
        sent: Rc<Cell<u64>>,
    ) -> Result<Self, BusError> {
        let name = opened.service.name;
        let notifier = match opened.wake {
            Some(wake) => Some(wake.notifier_builder().create().map_err(|error| BusError::broken(name, error))?),
            None => None,
        };
        Ok(Self { publisher, notifier, service: opened.data, connections, name, sent, known: RefCell::default() })
    }

    /// To be called after each send: wakes the readers and counts. Fails if a reader is without a connection.
    pub(crate) fn has_sent(&self) -> Result<(), BusError> {
        if let Some(notifier) = &self.notifier
            && let Err(error) = notifier.notify()
        {
            tracing::debug!("a reader of {} was not woken: {error:?}", self.name);
        }
        self.sent.set(self.sent.get() + 1);
        self.connections.check(&self.service)
    }

    /// How many readers there are.
    pub(crate) fn readers(&self) -> usize {
        self.service.dynamic_config().number_of_subscribers()
    }

    /// Whether a reader has joined since this was last asked. Readers are told apart by their identity: one may have left meanwhile.
    pub(crate) fn joined(&self) -> bool {
        let mut readers = Vec::new();
        self.service.dynamic_config().list_subscribers(|found| {
            readers.push(found.subscriber_id.value());
            CallbackProgression::Continue
        });
        let known = self.known.replace(readers);
        self.known.borrow().iter().any(|reader| !known.contains(reader))
    }
}
