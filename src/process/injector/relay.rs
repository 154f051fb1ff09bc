//! One routed service on the bus.

use ::injector::{Cargo, Counts, Line, News};
use bus::{BusError, Injection, Raw, Tap};
use messages::{CameraMotion, FilterVerdict, Payload, SonarMotion, SonarScan};
use runtime::Shell;
use settings::{PlannedFault, RoutedService, StreamFault};

/// Most messages taken in one round, so that the heartbeat is never late.
const TAKEN_PER_ROUND: usize = 256;

/// A message as it is in shared memory, which the line carries.
#[derive(Clone)]
struct Parcel<T: Payload>(Raw<T>);

impl<T: Payload> Cargo for Parcel<T> {
    fn seq(&self) -> u64 {
        self.0.seq()
    }

    fn stamp_ns(&self) -> u64 {
        self.0.stamp_ns()
    }

    fn is_end(&self) -> bool {
        self.0.is_end()
    }

    fn turn_over(&mut self, bit: u64) {
        self.0.turn_over(bit);
    }

    fn leave_gap(&mut self) {
        self.0.leave_gap();
    }

    fn put_forward(&mut self, by_ns: u64) {
        self.0.put_forward(by_ns);
    }
}

/// A service on its way through the injector, whatever it carries.
pub(super) trait Relay {
    /// Takes what waits and gives what may go on; true when there may be more.
    fn carry(&mut self, now_ns: u64) -> Result<bool, BusError>;
    /// Gives everything that is held back.
    fn flush(&mut self) -> Result<(), BusError>;
    /// When something held back is due, ns of deployment time.
    fn due_ns(&self) -> Option<u64>;
    /// Adds a fault of the settings.
    fn plan(&mut self, kind: StreamFault, fault: &PlannedFault);
    /// Adds a fault that begins now.
    fn disturb(&mut self, kind: StreamFault, fault: &PlannedFault);
    /// What has been done.
    fn counts(&self) -> Counts;
    /// What is to be told of its faults since this was last asked.
    fn take_news(&mut self) -> Vec<News>;
    /// Stamp of the first message, ns.
    fn began_ns(&self) -> Option<u64>;
}

struct Carrier<T: Payload> {
    tap: Tap<T>,
    injection: Injection<T>,
    line: Line<Parcel<T>>,
}

/// Opens a routed service; `began_ns` is the stamp of its first message when an earlier incarnation has seen it, and with
/// `tells_gaps` its readers are told what is left out.
pub(super) fn open(shell: &mut Shell, service: RoutedService, began_ns: Option<u64>, tells_gaps: bool) -> Result<Box<dyn Relay>, BusError> {
    Ok(match service {
        RoutedService::RobotScan => Box::new(Carrier::<SonarScan>::open(shell, began_ns, tells_gaps)?),
        RoutedService::SonarMotion => Box::new(Carrier::<SonarMotion>::open(shell, began_ns, tells_gaps)?),
        RoutedService::CameraMotion => Box::new(Carrier::<CameraMotion>::open(shell, began_ns, tells_gaps)?),
        RoutedService::Verdict => Box::new(Carrier::<FilterVerdict>::open(shell, began_ns, tells_gaps)?),
    })
}

impl<T: Payload> Carrier<T> {
    fn open(shell: &mut Shell, began_ns: Option<u64>, tells_gaps: bool) -> Result<Self, BusError> {
        Ok(Self { tap: shell.tap()?, injection: shell.injection()?, line: Line::new(began_ns, tells_gaps) })
    }

    fn give(&self, messages: &[Parcel<T>]) -> Result<(), BusError> {
        messages.iter().try_for_each(|message| self.injection.send(&message.0))
    }
}

impl<T: Payload> Relay for Carrier<T> {
    fn carry(&mut self, now_ns: u64) -> Result<bool, BusError> {
        let mut due = Vec::new();
        self.line.release(now_ns, &mut due);
        let mut taken = 0;
        while taken < TAKEN_PER_ROUND
            && let Some(message) = self.tap.take()?
        {
            self.line.take(Parcel(message), now_ns, &mut due);
            taken += 1;
        }
        self.give(&due)?;
        Ok(taken == TAKEN_PER_ROUND)
    }

    fn flush(&mut self) -> Result<(), BusError> {
        let mut rest = Vec::new();
        self.line.flush(&mut rest);
        self.give(&rest)
    }

    fn due_ns(&self) -> Option<u64> {
        self.line.due_ns()
    }

    fn plan(&mut self, kind: StreamFault, fault: &PlannedFault) {
        self.line.plan(kind, fault);
    }

    fn disturb(&mut self, kind: StreamFault, fault: &PlannedFault) {
        self.line.disturb(kind, fault);
    }

    fn counts(&self) -> Counts {
        self.line.counts()
    }

    fn take_news(&mut self) -> Vec<News> {
        self.line.take_news()
    }

    fn began_ns(&self) -> Option<u64> {
        self.line.began_ns()
    }
}
