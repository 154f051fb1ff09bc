//! A routed service on the bus.

use ::injector::{Counts, Envelope, FaultQueue, Report, Source};
use bus::{BusError, Injection, Raw, Tap};
use messages::{Payload, Pictures, ServiceVisitor, visit_services};
use runtime::Shell;
use settings::{PlannedFault, RoutedService, StreamFault};

/// Most messages taken in one step, so that a flood does not delay the heartbeat.
const MOST_AT_ONCE: usize = 256;

/// A message as it is in shared memory.
#[derive(Clone)]
struct RawMessage<T: Payload>(Raw<T>);

impl<T: Payload> Envelope for RawMessage<T> {
    fn seq(&self) -> u64 {
        self.0.seq()
    }

    fn stamp_ns(&self) -> u64 {
        self.0.stamp_ns()
    }

    fn is_end(&self) -> bool {
        self.0.is_end()
    }

    fn flip_bit(&mut self, bit: u64) {
        self.0.turn_over(bit);
    }

    fn make_gap(&mut self) {
        self.0.leave_gap();
    }

    fn advance_stamp(&mut self, by_ns: u64) {
        self.0.put_forward(by_ns);
    }
}

/// A service on its way through the injector, of any payload.
pub(super) trait Relay {
    /// Receives what waits and sends what is due; true when more may wait.
    fn carry(&mut self, now_ns: u64) -> Result<bool, BusError>;
    /// Sends everything that is held back.
    fn flush(&mut self) -> Result<(), BusError>;
    /// When the next message is due, ns of deployment time.
    fn due_ns(&self) -> Option<u64>;
    /// Adds a fault.
    fn add(&mut self, kind: StreamFault, fault: &PlannedFault, source: Source);
    /// What was done to the messages so far.
    fn counts(&self) -> Counts;
    /// Removes and returns the reports about faults.
    fn take_reports(&mut self) -> Vec<Report>;
    /// Stamp of the first message, ns.
    fn first_ns(&self) -> Option<u64>;
}

struct Carrier<T: Payload> {
    tap: Tap<T>,
    injection: Injection<T>,
    queue: FaultQueue<RawMessage<T>>,
}

/// Opens a routed service. `first_ns` is the stamp of its first message, if an earlier incarnation received it. With
/// `announces_gaps` its readers receive a notice for each dropped message.
pub(super) fn open(
    shell: &mut Shell,
    service: RoutedService,
    first_ns: Option<u64>,
    announces_gaps: bool,
) -> Result<Box<dyn Relay>, BusError> {
    let mut opening = Opening { shell, service: service.name(), first_ns, announces_gaps, relay: None };
    visit_services(&mut opening)?;
    opening.relay.ok_or(BusError::NoService { service: service.name() })
}

/// Opens the one service of the registry that has this name.
struct Opening<'a> {
    shell: &'a mut Shell,
    service: &'static str,
    first_ns: Option<u64>,
    announces_gaps: bool,
    relay: Option<Box<dyn Relay>>,
}

impl ServiceVisitor for Opening<'_> {
    type Error = BusError;

    fn message<T: Payload>(&mut self) -> Result<(), BusError> {
        if T::SERVICE.name == self.service {
            self.relay = Some(Box::new(Carrier::<T>::open(self.shell, self.first_ns, self.announces_gaps)?));
        }
        Ok(())
    }

    fn pictures<P: Pictures>(&mut self) -> Result<(), BusError> {
        Ok(())
    }
}

impl<T: Payload> Carrier<T> {
    fn open(shell: &mut Shell, first_ns: Option<u64>, announces_gaps: bool) -> Result<Self, BusError> {
        Ok(Self { tap: shell.tap()?, injection: shell.injection()?, queue: FaultQueue::new(first_ns, announces_gaps) })
    }

    fn send(&self, messages: &[RawMessage<T>]) -> Result<(), BusError> {
        messages.iter().try_for_each(|message| self.injection.send(&message.0))
    }
}

impl<T: Payload> Relay for Carrier<T> {
    fn carry(&mut self, now_ns: u64) -> Result<bool, BusError> {
        let mut due = Vec::new();
        self.queue.release(now_ns, &mut due);
        let mut taken = 0;
        while taken < MOST_AT_ONCE
            && let Some(message) = self.tap.take()?
        {
            self.queue.push(RawMessage(message), now_ns, &mut due);
            taken += 1;
        }
        self.send(&due)?;
        Ok(taken == MOST_AT_ONCE)
    }

    fn flush(&mut self) -> Result<(), BusError> {
        let mut rest = Vec::new();
        self.queue.flush(&mut rest);
        self.send(&rest)
    }

    fn due_ns(&self) -> Option<u64> {
        self.queue.due_ns()
    }

    fn add(&mut self, kind: StreamFault, fault: &PlannedFault, source: Source) {
        self.queue.add(kind, fault, source);
    }

    fn counts(&self) -> Counts {
        self.queue.counts()
    }

    fn take_reports(&mut self) -> Vec<Report> {
        self.queue.take_reports()
    }

    fn first_ns(&self) -> Option<u64> {
        self.queue.first_ns()
    }
}
