//! Where a robot is connected.

use std::fmt;
use std::path::PathBuf;

/// A serial device, or a TCP port behind which a robot simulator or a serial bridge is.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Address {
    /// A serial device, or a link to one.
    Device(PathBuf),
    /// A TCP port. It carries bytes as a serial line does, but has no speed.
    Network {
        /// Name or address of the host; an IPv6 address without brackets.
        host: String,
        /// The port.
        port: u16,
    },
}

impl Address {
    /// Whether it has a speed that must be found.
    #[must_use]
    pub fn has_speed(&self) -> bool {
        matches!(self, Self::Device(_))
    }
}

impl fmt::Display for Address {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Device(path) => path.display().fmt(f),
            Self::Network { host, port } if host.contains(':') => write!(f, "tcp://[{host}]:{port}"),
            Self::Network { host, port } => write!(f, "tcp://{host}:{port}"),
        }
    }
}
