//! What a reader knows of its stream, and what it therefore hands out.

use std::cell::RefCell;
use std::rc::Rc;

use bytemuck::Pod;
use messages::{Header, InputCounters, Invalid, Kind, Service, Text};

use crate::clock::DeploymentClock;
use crate::latency::Latencies;

/// Messages after which latencies are made out anew.
const LATENCIES_EVERY: u64 = 16;

/// What a reader hands out.
pub enum Received<M> {
    /// A message.
    Message(M),
    /// The stream ends: nothing comes after `seq`.
    End {
        /// Last number of the stream.
        seq: u64,
    },
}

/// What becomes of a message that has arrived.
pub(crate) enum Admission {
    /// It is handed out; so many are missing before it.
    Message { lost_before: u64 },
    /// It says that the stream ends after `seq`, for the first time.
    End { seq: u64 },
    /// It is whole, but cannot be meant.
    Refused { problem: String },
    /// It is not handed out: of another run, damaged, or had before.
    Dropped,
}

/// The reader's side of one service: counts, order and checks.
pub(crate) struct Stream {
    service: Service,
    run: u64,
    /// None for visitors, who are in nobody's way.
    clock: Option<DeploymentClock>,
    latencies: Box<Latencies>,
    counters: Rc<RefCell<InputCounters>>,
    last_seq: u64,
    last_stamp_ns: u64,
    ended: bool,
}

impl Stream {
    pub(crate) fn new(service: Service, run: u64, clock: Option<DeploymentClock>) -> Self {
        let counters = InputCounters { service: Text::new(service.name), ..InputCounters::default() };
        Self {
            service,
            run,
            clock,
            latencies: Box::new(Latencies::new()),
            counters: Rc::new(RefCell::new(counters)),
            last_seq: 0,
            last_stamp_ns: 0,
            ended: false,
        }
    }

    pub(crate) fn counters(&self) -> Rc<RefCell<InputCounters>> {
        self.counters.clone()
    }

    pub(crate) fn skip_to(&mut self, seq: u64) {
        self.last_seq = self.last_seq.max(seq);
    }

    pub(crate) fn ended(&self) -> bool {
        self.ended
    }

    /// Decides on a message, whose `checksum` is that of [`checksum`], and counts it. `validate` says whether a payload can be meant.
    pub(crate) fn admit(
        &mut self,
        header: &Header,
        checksum: impl FnOnce() -> u32,
        validate: impl FnOnce() -> Result<(), Invalid>,
    ) -> Admission {
        let service = self.service;
        let mut counters = self.counters.borrow_mut();
        if header.run != self.run {
            counters.refused += 1;
            return Admission::Dropped;
        }
        let found = checksum();
        if header.crc32 != found {
            counters.refused += 1;
            tracing::warn!(
                "refused message {} of {}: its checksum is {found:08x}, expected {:08x}",
                header.seq,
                service.name,
                header.crc32
            );
            return Admission::Dropped;
        }
        let kind = Kind::from_number(header.kind);
        let problem = if service.sequenced && header.seq > self.last_seq && header.stamp_ns < self.last_stamp_ns {
            Some(format!("its stamp {} ns is before {} ns", header.stamp_ns, self.last_stamp_ns))
        } else {
            match kind {
                None => Some(format!("its kind is {}, expected 0 or 1", header.kind)),
                Some(Kind::Data) => validate().err().map(|invalid| invalid.to_string()),
                Some(Kind::End) => None,
            }
        };
        if let Some(problem) = problem {
            counters.refused += 1;
            tracing::warn!("refused message {} of {}: {problem}", header.seq, service.name);
            return Admission::Refused { problem };
        }
        if kind == Some(Kind::End) {
            if self.ended {
                return Admission::Dropped;
            }
            self.ended = true;
            counters.lost += header.seq.saturating_sub(self.last_seq);
            self.last_seq = self.last_seq.max(header.seq);
            return Admission::End { seq: header.seq };
        }
        let mut lost_before = 0;
        if service.sequenced {
            if header.seq <= self.last_seq {
                counters.repeated += 1;
                return Admission::Dropped;
            }
            lost_before = header.seq - self.last_seq - 1;
            self.last_seq = header.seq;
            self.last_stamp_ns = header.stamp_ns;
        }
        if let Some(clock) = self.clock {
            self.latencies.take(clock.since(header.stamp_ns));
            // Often enough for whoever looks, too seldom to cost anything.
            if counters.received.is_multiple_of(LATENCIES_EVERY) {
                counters.latency_median_us = self.latencies.within_us(0.5);
                counters.latency_p99_us = self.latencies.within_us(0.99);
            }
        }
        counters.received += 1;
        counters.lost += lost_before;
        counters.last_seq = header.seq;
        Admission::Message { lost_before }
    }
}

/// CRC-32 of a message; in `header` the place of the checksum is 0.
pub(crate) fn checksum(header: &impl Pod, payload: &[u8]) -> u32 {
    let mut hasher = crc32fast::Hasher::new();
    hasher.update(bytemuck::bytes_of(header));
    hasher.update(payload);
    hasher.finalize()
}
