//! One input of a process: messages in order, each once, each valid.

use std::cell::RefCell;
use std::ops::Deref;
use std::rc::Rc;

use iceoryx2::port::listener::Listener;
use iceoryx2::port::subscriber::Subscriber;
use iceoryx2::prelude::ipc;
use iceoryx2::sample::Sample;
use messages::{Header, Payload, StreamCursor};

use crate::clock::DeploymentClock;
use crate::connections::Connections;
use crate::error::BusError;
use crate::fabric::{Opened, PubSub, listener};
use crate::slot::{HeaderSlot, Slot};
use crate::stream::{Account, Admission, Received, Stream, checksum};

/// Receives the messages of one service.
///
/// On a sequenced service it hands out each number once and in order, counts what is missing, and refuses stamps that run
/// backwards; on every service it refuses messages of another run, with a wrong checksum, or with numbers out of range.
///
/// ```
/// use stillmap_bus::{Domain, Ports, Received};
/// use messages::SonarScan;
///
/// let domain = Domain::open(&format!("example-reader-{}", std::process::id()), 1.0)?;
/// let membership = domain.membership_for("example", 0, "settings.toml".as_ref());
/// let mut ports = Ports::join(&membership)?;
/// let mut scans = ports.reader::<SonarScan>()?;
/// let mut driver = ports.writer::<SonarScan>()?;
/// driver.send(1, 1_000, &SonarScan::default())?;
/// driver.send(3, 3_000, &SonarScan::default())?;
/// driver.end(3, 3_000)?;
///
/// let mut lost = 0;
/// while let Some(received) = scans.take()? {
///     match received {
///         Received::Message(scan) => lost += scan.lost_before(),
///         Received::End { seq } => assert_eq!((seq, lost), (3, 1)),
///     }
/// }
/// assert!(scans.ended());
/// # drop((scans, driver, ports));
/// domain.close()?;
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct Reader<T: Payload> {
    subscriber: Subscriber<ipc::Service, Slot<T>, HeaderSlot>,
    listener: Option<Rc<Listener<ipc::Service>>>,
    connections: Connections,
    service: PubSub<T>,
    stream: Stream,
}

/// A message in shared memory, checked; it goes back to its sender when dropped.
///
/// ```
/// use stillmap_bus::{Domain, Ports, Received};
/// use messages::{Pose, SonarScan};
///
/// let domain = Domain::open(&format!("example-message-{}", std::process::id()), 1.0)?;
/// let membership = domain.membership_for("example", 0, "settings.toml".as_ref());
/// let mut ports = Ports::join(&membership)?;
/// let mut scans = ports.reader::<SonarScan>()?;
/// let mut driver = ports.writer::<SonarScan>()?;
/// driver.send(1, 1_000, &SonarScan::new(Pose::new(0.5, 0.0, 0.0), &[], false))?;
///
/// let Some(Received::Message(scan)) = scans.take()? else { panic!("a scan waits") };
/// // A message derefs to its payload.
/// assert_eq!((scan.seq(), scan.stamp_ns(), scan.pose.x_m), (1, 1_000, 0.5));
/// # drop(scan);
/// # drop((scans, driver, ports));
/// domain.close()?;
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct Message<T: Payload> {
    sample: Sample<ipc::Service, Slot<T>, HeaderSlot>,
    lost_before: u64,
}

impl<T: Payload> Reader<T> {
    pub(crate) fn new(opened: Opened<PubSub<T>>, run: u64, clock: Option<DeploymentClock>) -> Result<Self, BusError> {
        let connections = Connections::new(T::SERVICE.name);
        let builder = opened.data.subscriber_builder().set_degradation_handler(connections.on_failure());
        let subscriber = builder.create().map_err(|error| BusError::broken(T::SERVICE.name, error))?;
        let (listener, stream) = (listener(&opened)?, Stream::new(&T::SERVICE, run, clock));
        Ok(Self { subscriber, listener, connections, service: opened.data, stream })
    }

    /// The next message, if one waits.
    ///
    /// # Errors
    /// When the connection to a sender cannot be made.
    pub fn take(&mut self) -> Result<Option<Received<Message<T>>>, BusError> {
        loop {
            let received = self.subscriber.receive().map_err(|error| BusError::refused("cannot receive from", T::SERVICE.name, error))?;
            self.connections.check(&self.service)?;
            let Some(sample) = received else { return Ok(None) };
            let (header, payload) = (sample.user_header().0, &sample.payload().0);
            let found = || checksum(&Header { crc32: 0, ..header }, bytemuck::bytes_of(payload));
            match self.stream.admit(&header, found, || payload.validate()) {
                Admission::Message { lost_before } => return Ok(Some(Received::Message(Message { sample, lost_before }))),
                Admission::End { seq } => return Ok(Some(Received::End { seq })),
                Admission::Refused { .. } | Admission::Dropped => (),
            }
        }
    }

    /// Takes everything up to `seq`, which has this stamp, as received: a process that restarts resumes after what its
    /// checkpoint includes.
    pub fn skip_to(&mut self, seq: u64, stamp_ns: u64) {
        self.stream.skip_to(seq, stamp_ns);
    }

    /// The last message that was taken, refused, or is known not to come: no earlier one is handed out any more.
    #[must_use]
    pub fn passed(&self) -> u64 {
        self.stream.passed()
    }

    /// Whether the end of the stream has been taken.
    #[must_use]
    pub fn ended(&self) -> bool {
        self.stream.ended()
    }

    pub(crate) fn listener(&self) -> Option<Rc<Listener<ipc::Service>>> {
        self.listener.clone()
    }

    pub(crate) fn account(&self) -> Rc<RefCell<Account>> {
        self.stream.account()
    }
}

impl<T: Payload> Message<T> {
    /// Its place in the source stream.
    #[must_use]
    pub fn seq(&self) -> u64 {
        self.sample.user_header().0.seq
    }

    /// Sensor time, ns.
    #[must_use]
    pub fn stamp_ns(&self) -> u64 {
        self.sample.user_header().0.stamp_ns
    }

    /// Number and stamp.
    #[must_use]
    pub fn cursor(&self) -> StreamCursor {
        StreamCursor { seq: self.seq(), stamp_ns: self.stamp_ns() }
    }

    /// The run it belongs to.
    #[must_use]
    pub fn run(&self) -> u64 {
        self.sample.user_header().0.run
    }

    /// Messages missing between the one before and this one.
    #[must_use]
    pub fn lost_before(&self) -> u64 {
        self.lost_before
    }
}

impl<T: Payload> Deref for Message<T> {
    type Target = T;

    fn deref(&self) -> &T {
        &self.sample.payload().0
    }
}
