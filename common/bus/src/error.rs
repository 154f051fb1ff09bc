//! What can go wrong on the bus, in one closed list.

use std::io;
use std::path::PathBuf;
use std::time::Duration;

use iceoryx2::service::builder::event::{EventCreateError, EventOpenError};
use iceoryx2::service::builder::publish_subscribe::{PublishSubscribeCreateError, PublishSubscribeOpenError};

use crate::descriptors::has_no_descriptor;

/// Exit code of a process that found the domain itself broken: only wiping it helps.
///
/// ```
/// assert_eq!(stillmap_bus::EXIT_BROKEN_DOMAIN, 70);
/// ```
pub const EXIT_BROKEN_DOMAIN: u8 = 70;

/// A service, port or node that could not be had or used.
///
/// ```
/// use stillmap_bus::BusError;
///
/// let error = BusError::NoService { service: "robot/scan" };
/// assert!(!error.to_string().is_empty());
/// ```
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
    /// This process may open no more files, so that it cannot connect to another one.
    #[error("{service}: no connection to another process: no file descriptor is left (ulimit -n)")]
    NoDescriptor {
        /// Name of the service.
        service: String,
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
        let service = service.into();
        if has_no_descriptor() {
            return Self::NoDescriptor { service };
        }
        Self::Refused { what, service, detail: format!("{detail:?}") }
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

    /// A port that cannot be made because its places are taken by the dead, because the service is damaged, or because no file
    /// descriptor is left.
    pub(crate) fn broken(service: &'static str, detail: impl core::fmt::Debug) -> Self {
        if has_no_descriptor() {
            return Self::NoDescriptor { service: service.to_owned() };
        }
        Self::BrokenDomain { service, detail: format!("{detail:?}") }
    }

    /// Whether only wiping the domain helps.
    #[must_use]
    pub fn is_broken_domain(&self) -> bool {
        matches!(self, Self::BrokenDomain { .. })
    }
}

/// A domain that could not be opened, joined or cleaned.
///
/// ```
/// use stillmap_bus::{Domain, DomainError};
///
/// // A name has small letters, digits and hyphens.
/// let Err(error) = Domain::open("../elsewhere", 1.0) else { panic!("refused") };
/// let described: DomainError = error;
/// assert!(described.to_string().contains("elsewhere"));
/// ```
#[derive(Debug, thiserror::Error)]
pub enum DomainError {
    /// The name cannot be one.
    #[error("deployment name {name:?}: expected 1 to 40 of a-z, 0-9 and -")]
    Name {
        /// What was given.
        name: String,
    },
    /// A supervisor holds it.
    #[error("deployment {name} is already running (process {pid})")]
    Running {
        /// Its name.
        name: String,
        /// Process id of its supervisor, as it wrote it.
        pid: String,
    },
    /// No supervisor holds it.
    #[error("deployment {name} is not running")]
    NoDomain {
        /// Its name.
        name: String,
    },
    /// Processes of an earlier run are still alive in it.
    #[error("processes of an earlier run of {name} are still alive after {waited:?}")]
    StillInhabited {
        /// Its name.
        name: String,
        /// How long it was waited for them.
        waited: Duration,
    },
    /// The files of the bus would have longer names than the system takes.
    #[error("the runtime folder {folder} is {found} bytes long, expected at most {most}: set STILLMAP_RUNTIME_DIR to a shorter one")]
    LongFolder {
        /// The folder of the domain.
        folder: PathBuf,
        /// Its length.
        found: usize,
        /// The longest that can be.
        most: usize,
    },
    /// Too little shared memory.
    #[error("/dev/shm has {free} bytes free, expected at least {needed}: mount it with a larger size= (docker run --shm-size)")]
    SharedMemory {
        /// Bytes free.
        free: u64,
        /// Bytes needed.
        needed: u64,
    },
    /// The file system locks no files.
    #[error("{path}: cannot be locked: {source}: set STILLMAP_RUNTIME_DIR to a folder of a file system with locks")]
    NoLocks {
        /// The file.
        path: PathBuf,
        /// What the system says.
        source: io::Error,
    },
    /// The file system refuses.
    #[error("{path}: {source}")]
    Io {
        /// The file or folder.
        path: PathBuf,
        /// What it says.
        source: io::Error,
    },
    /// The bus fails.
    #[error("{0}")]
    Bus(#[from] BusError),
}
