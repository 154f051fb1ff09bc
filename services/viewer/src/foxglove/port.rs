//! The sockets of the port.

use std::net::{IpAddr, TcpStream};
use std::os::fd::{AsFd, BorrowedFd};
use std::time::Instant;

use super::feed::Feed;
use crate::listener::Listener;

/// The port with its clients.
pub struct Port {
    /// Accepts clients.
    pub listener: Listener,
    /// The clients and what they are sent.
    pub feed: Feed<TcpStream>,
}

impl Port {
    /// A port at this address, at the first free port of ten.
    pub fn new(address: IpAddr, first_port: u16, feed: Feed<TcpStream>) -> Self {
        Self { listener: Listener::new("port for Foxglove", address, first_port), feed }
    }

    /// Accepts clients and reads their requests.
    pub fn advance(&mut self, now: Instant) {
        for stream in self.listener.accept() {
            self.feed.add_client(stream, now);
        }
        self.feed.advance(now);
    }

    /// The descriptors that wake the process.
    pub fn descriptors(&self) -> impl Iterator<Item = BorrowedFd<'_>> {
        self.listener.descriptor().into_iter().chain(self.feed.streams().map(TcpStream::as_fd))
    }
}
