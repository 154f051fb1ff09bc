//! Connections between a sender and a reader that could not be made.
//!
//! iceoryx2 leaves such a connection out and continues: what would have passed over it is missing, and no error says so. Here it is an
//! error. Only a peer that is dying is left out in silence: its supervisor removes it from the list of the service.

use std::cell::Cell;
use std::fmt::Debug;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use iceoryx2::port::{DegradationAction, DegradationCause, DegradationInfo};
use iceoryx2::prelude::{CallbackProgression, IceoryxSend, PortFactory as _, ZeroCopySend, ipc};
use iceoryx2::service::port_factory::publish_subscribe::PortFactory;

use crate::descriptors::has_no_descriptor;
use crate::error::BusError;

/// How long a peer without a connection may stay listed. A supervisor removes a process that exited at once, and looks for dead
/// observers every second.
const LISTED: Duration = Duration::from_secs(3);
/// Most that counts of the time between two checks: a process that was stopped has not waited.
const LONGEST_CHECK: Duration = Duration::from_millis(200);

/// The connections of one port that failed.
#[derive(Debug)]
pub(crate) struct Connections {
    service: &'static str,
    failed: Arc<Mutex<Vec<Failed>>>,
    checked: Cell<Option<Instant>>,
    waited: Cell<Duration>,
}

#[derive(Debug, Clone, Copy)]
struct Failed {
    sender: u128,
    reader: u128,
    /// The process has no file descriptor left.
    no_descriptor: bool,
}

impl Connections {
    pub(crate) fn new(service: &'static str) -> Self {
        Self { service, failed: Arc::default(), checked: Cell::new(None), waited: Cell::default() }
    }

    /// What the port is to call for a connection that cannot be made or used.
    pub(crate) fn on_failure(&self) -> impl Fn(DegradationCause, &DegradationInfo) -> DegradationAction + Send + 'static {
        let failed = self.failed.clone();
        move |_, info| {
            let it = Failed { sender: info.sender_port_id, reader: info.receiver_port_id, no_descriptor: has_no_descriptor() };
            failed.lock().unwrap_or_else(PoisonError::into_inner).push(it);
            DegradationAction::Ignore
        }
    }

    /// Fails if a connection is missing to a peer that lives. To be called whenever the port is used.
    pub(crate) fn check<P, H>(&self, factory: &PortFactory<ipc::Service, P, H>) -> Result<(), BusError>
    where
        P: Debug + IceoryxSend + ?Sized,
        H: Debug + ZeroCopySend,
    {
        let mut failed = self.failed.lock().unwrap_or_else(PoisonError::into_inner);
        if failed.is_empty() {
            return Ok(());
        }
        if failed.iter().any(|it| it.no_descriptor) {
            return Err(BusError::NoDescriptor { service: self.service.to_owned() });
        }
        failed.retain(|it| is_listed(factory, it));
        let now = Instant::now();
        let waited = match self.checked.replace(Some(now)) {
            Some(checked) => self.waited.get() + now.duration_since(checked).min(LONGEST_CHECK),
            None => Duration::ZERO,
        };
        self.waited.set(waited);
        if failed.is_empty() {
            self.checked.set(None);
            return Ok(());
        }
        if waited < LISTED { Ok(()) } else { Err(BusError::broken(self.service, "a connection cannot be made")) }
    }
}

/// Whether both ends of a connection exist.
fn is_listed<P, H>(factory: &PortFactory<ipc::Service, P, H>, failed: &Failed) -> bool
where
    P: Debug + IceoryxSend + ?Sized,
    H: Debug + ZeroCopySend,
{
    let (mut sender, mut reader) = (false, false);
    let config = factory.dynamic_config();
    config.list_publishers(|found| {
        sender |= found.publisher_id.value() == failed.sender;
        CallbackProgression::Continue
    });
    config.list_subscribers(|found| {
        reader |= found.subscriber_id.value() == failed.reader;
        CallbackProgression::Continue
    });
    sender && reader
}
