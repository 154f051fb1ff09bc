//! A visitor of a running deployment: reads, and publishes nothing.

use std::fs::File;
use std::rc::Rc;
use std::time::Duration;

use iceoryx2::port::listener::Listener;
use iceoryx2::prelude::ipc;
use messages::{Payload, Pictures};
use rustix::event::{PollFd, PollFlags, poll};

use crate::broken::BusError;
use crate::domain::{DomainError, RunningDomain, join_members};
use crate::fabric::{Channel, Fabric};
use crate::frame_reader::FrameReader;
use crate::memory::{FOR_A_VISITOR, check_free};
use crate::reader::Reader;
use crate::shell::{drain, listener_descriptor, timespec};

/// A command that looks at a running deployment.
pub struct Tool {
    fabric: Fabric,
    run: u64,
    listeners: Vec<Rc<Listener<ipc::Service>>>,
    _member: File,
}

impl Tool {
    /// Joins a running deployment.
    ///
    /// # Errors
    /// When it has just ended, is of another version, or shared memory is used up.
    pub fn join(domain: &RunningDomain) -> Result<Self, DomainError> {
        check_free(FOR_A_VISITOR)?;
        let member = join_members(domain.paths())?;
        let fabric = Fabric::join(domain.paths(), "tool")?;
        Ok(Self { fabric, run: domain.run(), listeners: Vec::new(), _member: member })
    }

    /// Opens an input; its messages end a wait.
    ///
    /// # Errors
    /// When the service does not exist or cannot be used.
    pub fn reader<T: Payload>(&mut self) -> Result<Reader<T>, BusError> {
        let reader = Reader::new(&self.fabric.open(Channel::Open)?, self.run, None)?;
        self.listeners.extend(reader.listener());
        Ok(reader)
    }

    /// Opens an input of pictures; they end a wait.
    ///
    /// # Errors
    /// When the service does not exist or cannot be used.
    pub fn frame_reader<P: Pictures>(&mut self) -> Result<FrameReader<P>, BusError> {
        let reader = FrameReader::new(&self.fabric.open_pictures::<P>()?, self.run, None)?;
        self.listeners.extend(reader.listener());
        Ok(reader)
    }

    /// Waits until a message comes on any input, or for `patience`.
    ///
    /// # Errors
    /// When the system refuses to wait.
    pub fn wait(&self, patience: Duration) -> std::io::Result<()> {
        let mut polled: Vec<PollFd<'_>> =
            self.listeners.iter().map(|listener| PollFd::from_borrowed_fd(listener_descriptor(listener), PollFlags::IN)).collect();
        match poll(&mut polled, Some(&timespec(patience))) {
            Ok(_) | Err(rustix::io::Errno::INTR) => (),
            Err(error) => return Err(error.into()),
        }
        self.listeners.iter().for_each(|listener| drain(listener));
        Ok(())
    }
}
