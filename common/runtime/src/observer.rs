//! An observer of a running deployment: it reads and publishes nothing.

use std::time::Duration;

use bus::{BusError, DomainError, FrameReader, Ports, Reader, RunningDomain};
use messages::{Payload, Pictures};

/// A command that looks at a running deployment.
pub struct Observer {
    ports: Ports,
}

impl Observer {
    /// Joins a running deployment.
    ///
    /// # Errors
    /// When it has just ended, is of another version, or shared memory is used up.
    pub fn join(domain: &RunningDomain) -> Result<Self, DomainError> {
        Ok(Self { ports: Ports::observe(domain)? })
    }

    /// Opens an input; its messages end a wait.
    ///
    /// # Errors
    /// When the service does not exist or cannot be used.
    pub fn reader<T: Payload>(&mut self) -> Result<Reader<T>, BusError> {
        self.ports.reader()
    }

    /// Opens an input of pictures; they end a wait.
    ///
    /// # Errors
    /// When the service does not exist or cannot be used.
    pub fn frame_reader<P: Pictures>(&mut self) -> Result<FrameReader<P>, BusError> {
        self.ports.frame_reader()
    }

    /// Waits until a message comes on any input, or for `patience`.
    ///
    /// # Errors
    /// When the system refuses to wait.
    pub fn wait(&self, patience: Duration) -> std::io::Result<()> {
        self.ports.wait(&[], patience)
    }
}
