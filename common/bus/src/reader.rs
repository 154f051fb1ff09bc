//! One input of a process: messages in order, each once, each valid.

use std::cell::RefCell;
use std::ops::Deref;
use std::rc::Rc;

use iceoryx2::port::listener::Listener;
use iceoryx2::port::subscriber::Subscriber;
use iceoryx2::prelude::ipc;
use iceoryx2::sample::Sample;
use messages::{InputCounters, Kind, Payload, Text};

use crate::broken::BusError;
use crate::fabric::{Opened, listener};
use crate::slot::{HeaderSlot, Slot};

/// Receives the messages of one service.
///
/// On a sequenced service it hands out each number once and in order, counts what is missing, and refuses stamps that run
/// backwards; on every service it refuses messages of another run, with a wrong checksum, or with numbers out of range.
pub struct Reader<T: Payload> {
    subscriber: Subscriber<ipc::Service, Slot<T>, HeaderSlot>,
    listener: Option<Rc<Listener<ipc::Service>>>,
    counters: Rc<RefCell<InputCounters>>,
    run: u64,
    last_seq: u64,
    last_stamp_ns: u64,
    ended: bool,
}

/// What a reader hands out.
pub enum Received<T: Payload> {
    /// A message.
    Message(Message<T>),
    /// The stream ends: nothing comes after `seq`.
    End {
        /// Last number of the stream.
        seq: u64,
    },
}

/// A message in shared memory, checked; it goes back to its sender when dropped.
pub struct Message<T: Payload> {
    sample: Sample<ipc::Service, Slot<T>, HeaderSlot>,
    lost_before: u64,
}

impl<T: Payload> Reader<T> {
    pub(crate) fn new(opened: &Opened<T>, run: u64) -> Result<Self, BusError> {
        let subscriber = opened.data.subscriber_builder().create().map_err(|error| BusError::broken(T::SERVICE.name, error))?;
        let counters = InputCounters { service: Text::new(T::SERVICE.name), ..InputCounters::default() };
        Ok(Self {
            subscriber,
            listener: listener(opened)?,
            counters: Rc::new(RefCell::new(counters)),
            run,
            last_seq: 0,
            last_stamp_ns: 0,
            ended: false,
        })
    }

    /// The next message, if one waits.
    ///
    /// # Errors
    /// When the connection to a sender cannot be made.
    pub fn take(&mut self) -> Result<Option<Received<T>>, BusError> {
        loop {
            let received = self.subscriber.receive().map_err(|error| BusError::refused("cannot receive from", T::SERVICE.name, error))?;
            let Some(sample) = received else { return Ok(None) };
            if let Some(received) = self.accept(sample) {
                return Ok(Some(received));
            }
        }
    }

    /// Takes everything up to `seq` as received: a process that restarts goes on after what its checkpoint includes.
    pub fn skip_to(&mut self, seq: u64) {
        self.last_seq = self.last_seq.max(seq);
    }

    /// Whether the end of the stream has been taken.
    #[must_use]
    pub fn ended(&self) -> bool {
        self.ended
    }

    pub(crate) fn listener(&self) -> Option<Rc<Listener<ipc::Service>>> {
        self.listener.clone()
    }

    pub(crate) fn counters(&self) -> Rc<RefCell<InputCounters>> {
        self.counters.clone()
    }

    fn accept(&mut self, sample: Sample<ipc::Service, Slot<T>, HeaderSlot>) -> Option<Received<T>> {
        let header = sample.user_header().0;
        let payload = &sample.payload().0;
        let mut counters = self.counters.borrow_mut();
        if header.run != self.run {
            counters.refused += 1;
            return None;
        }
        let kind = Kind::from_number(header.kind);
        let problem = if header.crc32 != crc32fast::hash(bytemuck::bytes_of(payload)) {
            Some("its checksum is wrong".to_owned())
        } else if T::SERVICE.sequenced && header.seq > self.last_seq && header.stamp_ns < self.last_stamp_ns {
            Some(format!("its stamp {} ns is before {} ns", header.stamp_ns, self.last_stamp_ns))
        } else {
            match kind {
                None => Some(format!("its kind is {}, expected 0 or 1", header.kind)),
                Some(Kind::Data) => payload.validate().err().map(|invalid| invalid.to_string()),
                Some(Kind::End) => None,
            }
        };
        if let Some(problem) = problem {
            counters.refused += 1;
            tracing::warn!("refused message {} of {}: {problem}", header.seq, T::SERVICE.name);
            return None;
        }
        if kind == Some(Kind::End) {
            if self.ended {
                return None;
            }
            self.ended = true;
            counters.lost += header.seq.saturating_sub(self.last_seq);
            self.last_seq = self.last_seq.max(header.seq);
            return Some(Received::End { seq: header.seq });
        }
        let mut lost_before = 0;
        if T::SERVICE.sequenced {
            if header.seq <= self.last_seq {
                counters.repeated += 1;
                return None;
            }
            lost_before = header.seq - self.last_seq - 1;
            self.last_seq = header.seq;
            self.last_stamp_ns = header.stamp_ns;
        }
        counters.received += 1;
        counters.lost += lost_before;
        counters.last_seq = header.seq;
        drop(counters);
        Some(Received::Message(Message { sample, lost_before }))
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
