//! The sockets of the page.

use std::net::{IpAddr, TcpStream};
use std::os::fd::{AsFd, BorrowedFd};
use std::time::Instant;

use crate::access::Access;
use crate::board::Board;
use crate::connection::{Command, Connection, Offer, Site};
use crate::listener::Listener;

/// Most connections at a time; further ones are closed at once.
const MOST_CONNECTIONS: usize = 32;

/// Serves whoever comes to the page's address.
pub struct Server {
    /// Accepts browsers.
    pub listener: Listener,
    access: Access,
    obeys: bool,
    connections: Vec<Connection<TcpStream>>,
    /// Counts of what was sent.
    pub served: Served,
}

/// What was served so far.
#[derive(Debug, Clone, Copy, Default)]
pub struct Served {
    /// Rounds in which a browser was sent something.
    pub frames: u64,
    /// Bytes of messages.
    pub bytes: u64,
    /// Rounds that a browser missed because it had not taken those before.
    pub missed: u64,
    /// Connections that were closed at once because there were enough.
    pub turned_away: u64,
}

impl Server {
    /// A page at this address, at the first free port of ten.
    pub fn new(address: IpAddr, first_port: u16, access: Access, obeys: bool) -> Self {
        let listener = Listener::new("page", address, first_port);
        Self { listener, access, obeys, connections: Vec::new(), served: Served::default() }
    }

    /// What wakes the process.
    pub fn descriptors(&self) -> impl Iterator<Item = BorrowedFd<'_>> {
        let streams = self.connections.iter().filter_map(Connection::stream);
        self.listener.descriptor().into_iter().chain(streams.map(TcpStream::as_fd))
    }

    /// Takes new connections and what the others say; the commands among it.
    pub fn advance(&mut self, now: Instant) -> Vec<Command> {
        self.accept(now);
        let site = Site { access: &self.access, obeys: self.obeys };
        let commands = self.connections.iter_mut().flat_map(|connection| connection.advance(site, now)).collect();
        self.connections.retain(|connection| !connection.is_over());
        commands
    }

    /// Sends everybody what he lacks.
    pub fn offer(&mut self, board: &Board, now: Instant) {
        for connection in &mut self.connections {
            match connection.offer(board, now) {
                Offer::Taken(0) | Offer::Absent => {}
                Offer::Taken(bytes) => {
                    self.served.frames += 1;
                    self.served.bytes += bytes as u64;
                }
                Offer::Missed => self.served.missed += 1,
            }
        }
        self.connections.retain(|connection| !connection.is_over());
    }

    /// Browsers that watch.
    pub fn watching(&self) -> usize {
        self.connections.iter().filter(|connection| connection.is_watching()).count()
    }

    /// Whether a stream has not taken everything yet.
    pub fn is_writing(&self) -> bool {
        self.connections.iter().any(Connection::is_writing)
    }

    /// Whether somebody who watches lacks something.
    pub fn is_behind(&self, board: &Board) -> bool {
        self.connections.iter().any(|connection| connection.is_behind(board))
    }

    /// Says to everybody that nothing more comes.
    pub fn bid_farewell(&mut self) {
        self.connections.iter_mut().for_each(Connection::bid_farewell);
    }

    fn accept(&mut self, now: Instant) {
        for stream in self.listener.accept() {
            if self.connections.len() < MOST_CONNECTIONS {
                self.connections.push(Connection::new(stream, now));
            } else {
                self.served.turned_away += 1;
            }
        }
    }
}
