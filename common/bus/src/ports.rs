//! The ports of one process: what it reads, what it writes, and what wakes it.

use std::cell::{Cell, RefCell};
use std::fs::File;
use std::io;
use std::os::fd::BorrowedFd;
use std::rc::Rc;
use std::time::Duration;

use iceoryx2::port::listener::Listener;
use iceoryx2::prelude::{FileDescriptorBased, ipc};
use messages::{InputCounters, Payload, Pictures};

use crate::clock::DeploymentClock;
use crate::error::{BusError, DomainError};
use crate::fabric::{Channel, Fabric};
use crate::frame_reader::FrameReader;
use crate::frame_writer::FrameWriter;
use crate::locks::{Visit, join_members};
use crate::membership::Membership;
use crate::memory::{FOR_AN_OBSERVER, check_free};
use crate::outlet::Refresh;
use crate::paths::DomainPaths;
use crate::raw::{Injection, Tap};
use crate::reader::Reader;
use crate::running::RunningDomain;
use crate::stream::Account;
use crate::wait::wait_readable;
use crate::writer::Writer;

/// The ports of a process in a domain.
///
/// Services are opened, never created: they exist as long as their domain does. Readers and writers are used by the process
/// itself; what they have in common is here: the descriptors that wake it, its counters, and the history that readers get which
/// join after a message was sent.
///
/// ```
/// use std::time::Duration;
/// use stillmap_bus::{Domain, Ports, Received};
/// use messages::{Pose, SonarScan};
///
/// let domain = Domain::open(&format!("example-ports-{}", std::process::id()), 1.0)?;
/// let membership = domain.membership_for("example", 0, "settings.toml".as_ref());
/// let mut ports = Ports::join(&membership)?;
/// let mut scans = ports.reader::<SonarScan>()?;
/// let mut driver = ports.writer::<SonarScan>()?;
/// driver.send(1, 1_000, &SonarScan::new(Pose::default(), &[], false))?;
/// ports.wait(&[], Duration::from_secs(1))?;
/// assert!(matches!(scans.take()?, Some(Received::Message(_))));
/// # drop((scans, driver, ports));
/// domain.close()?;
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct Ports {
    fabric: Fabric,
    run: u64,
    /// None where latencies are not measured.
    clock: Option<DeploymentClock>,
    /// Services whose messages do not go straight to their readers.
    routed: Vec<String>,
    listeners: Vec<Rc<Listener<ipc::Service>>>,
    writers: Vec<Rc<dyn Refresh>>,
    inputs: Vec<Rc<RefCell<Account>>>,
    sent: Rc<Cell<u64>>,
    /// Dropped last: until then something of this process is on the bus.
    _presence: Presence,
}

/// What a process has in a domain.
pub(crate) enum Presence {
    /// The whole of it: its supervisor.
    Supervisor,
    /// A share of the lock that a supervisor waits for.
    Process { _share: File },
    /// None: neither an observer that stays nor one that is stopped delays the end of a run.
    Observer { _visit: Visit },
}

impl Ports {
    /// Joins the domain that the membership names.
    ///
    /// # Errors
    /// When the domain is gone, broken, or of another version.
    pub fn join(membership: &Membership) -> Result<Self, DomainError> {
        let paths = DomainPaths::of_directory(membership.directory())
            .ok_or_else(|| DomainError::NoDomain { name: membership.directory().display().to_string() })?;
        let presence = Presence::Process { _share: join_members(&paths)? };
        let fabric = Fabric::join(&paths, membership.process())?;
        let ports = Self::new(fabric, membership.run(), presence);
        Ok(Self { clock: Some(membership.clock()), routed: membership.routed.clone(), ..ports })
    }

    /// Joins a running deployment as one that only reads.
    ///
    /// # Errors
    /// When it has just ended, is of another version, or shared memory is used up.
    pub fn observe(domain: &RunningDomain) -> Result<Self, DomainError> {
        check_free(FOR_AN_OBSERVER)?;
        let presence = Presence::Observer { _visit: Visit::to(domain.paths())? };
        Ok(Self::new(Fabric::join(domain.paths(), "tool")?, domain.run(), presence))
    }

    pub(crate) fn new(fabric: Fabric, run: u64, presence: Presence) -> Self {
        let (listeners, writers, inputs) = (Vec::new(), Vec::new(), Vec::new());
        Self { fabric, run, clock: None, routed: Vec::new(), listeners, writers, inputs, sent: Rc::default(), _presence: presence }
    }

    /// Opens an input: its messages wake the process, and it has a place among the counters of inputs.
    ///
    /// # Errors
    /// When the service does not exist or cannot be used.
    pub fn reader<T: Payload>(&mut self) -> Result<Reader<T>, BusError> {
        let reader = Reader::new(self.fabric.open(Channel::Open)?, self.run, self.clock)?;
        self.listeners.extend(reader.listener());
        self.inputs.push(reader.account());
        Ok(reader)
    }

    /// Opens an input that has no place among the counters of inputs.
    ///
    /// # Errors
    /// As [`Ports::reader`].
    pub fn uncounted_reader<T: Payload>(&mut self) -> Result<Reader<T>, BusError> {
        let reader = Reader::new(self.fabric.open(Channel::Open)?, self.run, None)?;
        self.listeners.extend(reader.listener());
        Ok(reader)
    }

    /// Opens an output.
    ///
    /// # Errors
    /// When the service does not exist or cannot be used.
    pub fn writer<T: Payload>(&mut self) -> Result<Writer<T>, BusError> {
        let is_routed = self.routed.iter().any(|name| name == T::SERVICE.name);
        let channel = if is_routed { Channel::Tapped } else { Channel::Open };
        let writer = Writer::new(self.fabric.open(channel)?, self.run, self.sent.clone())?;
        self.writers.push(writer.refresh());
        Ok(writer)
    }

    /// Opens an output straight to its readers, of which the messages are not counted.
    ///
    /// # Errors
    /// As [`Ports::writer`].
    pub fn uncounted_writer<T: Payload>(&mut self) -> Result<Writer<T>, BusError> {
        let writer = Writer::new(self.fabric.open(Channel::Open)?, self.run, Rc::default())?;
        self.writers.push(writer.refresh());
        Ok(writer)
    }

    /// Opens what others send on a routed service, before its readers get it.
    ///
    /// # Errors
    /// When the service is not routed in this deployment, or cannot be used.
    pub fn tap<T: Payload>(&mut self) -> Result<Tap<T>, BusError> {
        let tap = Tap::new(self.fabric.open(Channel::Tapped)?)?;
        self.listeners.extend(tap.listener());
        Ok(tap)
    }

    /// Opens the way to the readers of a routed service.
    ///
    /// # Errors
    /// When the service does not exist or cannot be used.
    pub fn injection<T: Payload>(&mut self) -> Result<Injection<T>, BusError> {
        let injection = Injection::new(self.fabric.open(Channel::Open)?, self.sent.clone())?;
        self.writers.push(injection.refresh());
        Ok(injection)
    }

    /// Opens an input of pictures: they wake the process, and it has a place among the counters of inputs.
    ///
    /// # Errors
    /// When the service does not exist or cannot be used.
    pub fn frame_reader<P: Pictures>(&mut self) -> Result<FrameReader<P>, BusError> {
        let reader = FrameReader::new(self.fabric.open_pictures::<P>()?, self.run, self.clock)?;
        self.listeners.extend(reader.listener());
        self.inputs.push(reader.account());
        Ok(reader)
    }

    /// Opens an output of pictures.
    ///
    /// # Errors
    /// When the service does not exist or cannot be used.
    pub fn frame_writer<P: Pictures>(&mut self) -> Result<FrameWriter<P>, BusError> {
        let writer = FrameWriter::new(self.fabric.open_pictures::<P>()?, self.run, self.sent.clone())?;
        self.writers.push(writer.refresh());
        Ok(writer)
    }

    /// Waits until a message comes on an input, one of `others` is readable, a signal comes, or `patience` is over.
    ///
    /// # Errors
    /// When the system refuses to wait.
    pub fn wait(&self, others: &[BorrowedFd<'_>], patience: Duration) -> io::Result<()> {
        wait_readable(self.descriptors().into_iter().chain(others.iter().copied()), patience)?;
        self.drain();
        Ok(())
    }

    /// Descriptors that become readable when a message waits on an input, for a process with a poll of its own.
    #[must_use]
    pub fn descriptors(&self) -> Vec<BorrowedFd<'_>> {
        self.listeners.iter().map(|listener| descriptor(listener)).collect()
    }

    /// Takes the wake-ups that came so far, so that the descriptors are readable for the next ones only.
    pub fn drain(&self) {
        for listener in &self.listeners {
            if let Err(error) = listener.try_wait(|_| ()) {
                tracing::debug!("cannot drain a wake-up: {error:?}");
            }
        }
    }

    /// Sends readers that have joined since the last message the history; to be called a few times a second.
    pub fn refresh(&self) {
        self.writers.iter().for_each(|writer| writer.refresh());
    }

    /// Messages and pictures sent on the counted outputs.
    #[must_use]
    pub fn sent(&self) -> u64 {
        self.sent.get()
    }

    /// The counters of the inputs, in the order in which they were opened.
    pub fn inputs(&self) -> impl ExactSizeIterator<Item = InputCounters> {
        self.inputs.iter().map(|input| input.borrow().counters)
    }

    /// How far a source stream is answered by a process that has answered every message up to `seq` which it was given: what was
    /// refused or is known not to come after that needs no answer.
    #[must_use]
    pub fn answered(&self, service: &str, seq: u64) -> u64 {
        let account = self.inputs.iter().map(|input| input.borrow()).find(|input| input.counters.service.as_str() == service);
        account.map_or(seq, |input| input.answered(seq))
    }

    pub(crate) fn fabric(&self) -> &Fabric {
        &self.fabric
    }
}

/// The descriptor that becomes readable when the listener's service wakes its readers.
fn descriptor(listener: &Listener<ipc::Service>) -> BorrowedFd<'_> {
    // SAFETY: the listener owns the descriptor and keeps it open as long as it lives, which the borrow outlasts not.
    #[expect(unsafe_code, reason = "iceoryx2 hands out the raw number only")]
    unsafe {
        BorrowedFd::borrow_raw(listener.file_descriptor().native_handle())
    }
}
