//! The supervisor's own place on the bus.

use crate::notices::Log;
use bus::{BusError, DeploymentClock, Domain, Reader, Writer};
use messages::{DeploymentStatus, Heartbeat, MapSummary};

/// The supervisor's own inputs and outputs.
pub(crate) struct Ports {
    pub(crate) heartbeats: Reader<Heartbeat>,
    pub(crate) summaries: Reader<MapSummary>,
    pub(crate) statuses: Writer<DeploymentStatus>,
    pub(crate) log: Log,
}

impl Ports {
    pub(crate) fn open(domain: &mut Domain, clock: DeploymentClock) -> Result<Self, BusError> {
        let log = Log::new(domain.writer()?, clock);
        Ok(Self { heartbeats: domain.reader()?, summaries: domain.reader()?, statuses: domain.writer()?, log })
    }
}
