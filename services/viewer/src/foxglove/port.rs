//! The socket of the port.

use std::net::{IpAddr, TcpStream};
use std::os::fd::{AsFd, BorrowedFd};
use std::time::Instant;

use super::feed::Feed;
use crate::listener::Listener;

/// Where Foxglove connects to.
pub struct Port {
    /// Accepts clients.
    pub listener: Listener,
    /// The clients and what they are sent.
    pub feed: Feed<TcpStream>,
}

impl Port {
    /// A port at this address, the first free one of ten.
    pub fn new(address: IpAddr, first_port: u16, feed: Feed<TcpStream>) -> Self {
        Self { listener: Listener::new("port for Foxglove", address, first_port), feed }
    }

    /// Takes who has come and what clients ask for.
    pub fn advance(&mut self, now: Instant) {
        for stream in self.listener.accept() {
            self.feed.admit(stream, now);
        }
        self.feed.advance(now);
    }

    /// What wakes the process.
    pub fn descriptors(&self) -> impl Iterator<Item = BorrowedFd<'_>> {
        self.listener.descriptor().into_iter().chain(self.feed.streams().map(TcpStream::as_fd))
    }
}
