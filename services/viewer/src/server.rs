//! The sockets of the page.

use std::net::{IpAddr, TcpStream};
use std::os::fd::{AsFd, BorrowedFd};
use std::time::Instant;

use crate::access::Access;
use crate::board::Board;
use crate::connection::{Command, Connection, Offer, Site};
use crate::listener::Listener;

/// Most connections; further ones are closed at once.
const MOST_CONNECTIONS: usize = 32;

/// Serves the page and its data.
pub struct Server {
    /// Accepts browsers.
    pub listener: Listener,
    access: Access,
    accepts_commands: bool,
    connections: Vec<Connection<TcpStream>>,
    /// Counters.
    pub served: Served,
    /// The newest state of the processes, as [`crate::metrics()`] has it.
    pub metrics: Option<String>,
}

/// Counters of a server.
#[derive(Debug, Clone, Copy, Default)]
pub struct Served {
    /// Updates sent.
    pub updates: u64,
    /// Bytes of these updates.
    pub bytes: u64,
    /// Updates that a browser missed because it was stalled.
    pub missed: u64,
    /// Connections closed at once because there were too many.
    pub refused: u64,
}

impl Server {
    /// A server at this address, at the first free port of ten.
    pub fn new(address: IpAddr, first_port: u16, access: Access, accepts_commands: bool) -> Self {
        let listener = Listener::new("page", address, first_port);
        Self { listener, access, accepts_commands, connections: Vec::new(), served: Served::default(), metrics: None }
    }

    /// The descriptors that wake the process.
    pub fn descriptors(&self) -> impl Iterator<Item = BorrowedFd<'_>> {
        let streams = self.connections.iter().filter_map(Connection::stream);
        self.listener.descriptor().into_iter().chain(streams.map(TcpStream::as_fd))
    }

    /// Accepts connections and reads requests; returns the commands.
    pub fn advance(&mut self, now: Instant) -> Vec<Command> {
        self.accept(now);
        let site = Site { access: &self.access, accepts_commands: self.accepts_commands, metrics: self.metrics.as_deref() };
        let commands = self.connections.iter_mut().flat_map(|connection| connection.advance(site, now)).collect();
        self.connections.retain(|connection| !connection.is_closed());
        commands
    }

    /// Sends every browser its update.
    pub fn offer(&mut self, board: &Board, now: Instant) {
        for connection in &mut self.connections {
            match connection.offer(board, now) {
                Offer::Sent(0) | Offer::NotWatching => {}
                Offer::Sent(bytes) => {
                    self.served.updates += 1;
                    self.served.bytes += bytes as u64;
                }
                Offer::Missed => self.served.missed += 1,
            }
        }
        self.connections.retain(|connection| !connection.is_closed());
    }

    /// Number of browsers that show the page.
    pub fn watching(&self) -> usize {
        self.connections.iter().filter(|connection| connection.is_watching()).count()
    }

    /// Whether something is still to be written to a stream.
    pub fn is_writing(&self) -> bool {
        self.connections.iter().any(Connection::is_writing)
    }

    /// Whether a browser has not received everything.
    pub fn is_behind(&self, board: &Board) -> bool {
        self.connections.iter().any(|connection| connection.is_behind(board))
    }

    /// Closes every connection because the run has ended.
    pub fn close(&mut self) {
        self.connections.iter_mut().for_each(Connection::close);
    }

    fn accept(&mut self, now: Instant) {
        for stream in self.listener.accept() {
            if self.connections.len() < MOST_CONNECTIONS {
                self.connections.push(Connection::new(stream, now));
            } else {
                self.served.refused += 1;
            }
        }
    }
}
