//! What can go wrong on the bus, in one closed list.

use iceoryx2::service::builder::event::{EventCreateError, EventOpenError};
use iceoryx2::service::builder::publish_subscribe::{PublishSubscribeCreateError, PublishSubscribeOpenError};

/// Exit code of a process that found the domain itself broken: only wiping it helps.
pub const EXIT_BROKEN_DOMAIN: u8 = 70;

/// A service, port or node that could not be had or used.
#[derive(Debug, thiserror::Error)]
pub enum BusError {
    /// The service is not there: the deployment is not running, or is another one.
    #[error("service {service} does not exist in this domain: is its supervisor running?")]
    NoService {
        /// Name of the service.
        service: &'static str,
    },
    /// The service carries another version or layout of the payload.
    #[error("service {service} is spoken in another version here: expected version {version}, layout {layout:016x}")]
    OtherVersion {
        /// Name of the service.
        service: &'static str,
        /// Version this process speaks.
        version: u32,
        /// Layout hash this process speaks.
        layout: u64,
    },
    /// A process died at the one moment that leaves a service unusable; the supervisor wipes the domain and starts anew.
    #[error("the domain is broken at {service}: {detail}")]
    BrokenDomain {
        /// Name of the service.
        service: &'static str,
        /// What iceoryx2 says.
        detail: String,
    },
    /// Anything else that iceoryx2 refuses.
    #[error("{what} {service}: {detail}")]
    Refused {
        /// The operation.
        what: &'static str,
        /// Name of the service or node.
        service: String,
        /// What iceoryx2 says.
        detail: String,
    },
}

impl BusError {
    pub(crate) fn refused(what: &'static str, service: impl Into<String>, detail: impl core::fmt::Debug) -> Self {
        Self::Refused { what, service: service.into(), detail: format!("{detail:?}") }
    }

    pub(crate) fn opening(service: &messages::Service, layout: u64, error: PublishSubscribeOpenError) -> Self {
        use PublishSubscribeOpenError as E;
        match error {
            E::DoesNotExist => Self::NoService { service: service.name },
            E::IncompatibleAttributes | E::IncompatibleTypes => {
                Self::OtherVersion { service: service.name, version: service.version, layout }
            }
            E::HangsInCreation | E::ServiceInCorruptedState | E::ExceedsMaxNumberOfNodes => Self::broken(service.name, error),
            other => Self::refused("cannot open", service.name, other),
        }
    }

    pub(crate) fn opening_event(service: &'static str, error: EventOpenError) -> Self {
        use EventOpenError as E;
        match error {
            E::DoesNotExist => Self::NoService { service },
            E::HangsInCreation | E::ServiceInCorruptedState | E::ExceedsMaxNumberOfNodes => Self::broken(service, error),
            other => Self::refused("cannot open the event of", service, other),
        }
    }

    pub(crate) fn creating(service: &'static str, error: PublishSubscribeCreateError) -> Self {
        Self::refused("cannot create", service, error)
    }

    pub(crate) fn creating_event(service: &'static str, error: EventCreateError) -> Self {
        Self::refused("cannot create the event of", service, error)
    }

    /// A port that cannot be made because its places are taken by the dead, or because the service is damaged.
    pub(crate) fn broken(service: &'static str, detail: impl core::fmt::Debug) -> Self {
        Self::BrokenDomain { service, detail: format!("{detail:?}") }
    }

    /// Whether only wiping the domain helps.
    #[must_use]
    pub fn is_broken_domain(&self) -> bool {
        matches!(self, Self::BrokenDomain { .. })
    }
}
