//! The sockets of the page.

use std::io;
use std::net::{IpAddr, SocketAddr, TcpListener, TcpStream};
use std::os::fd::{AsFd, BorrowedFd};
use std::time::Instant;

use crate::access::Access;
use crate::board::Board;
use crate::connection::{Command, Connection, Offer, Site};

/// Most connections at a time; further ones are closed at once.
const MOST_CONNECTIONS: usize = 32;
/// Ports tried, from the first on.
const PORTS: u16 = 10;

/// Listens at the page's address and serves whoever comes.
pub(crate) struct Server {
    listener: TcpListener,
    access: Access,
    obeys: bool,
    connections: Vec<Connection<TcpStream>>,
    pub(crate) served: Served,
}

/// What was served so far.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Served {
    pub(crate) frames: u64,
    pub(crate) bytes: u64,
    pub(crate) missed: u64,
    pub(crate) turned_away: u64,
}

impl Server {
    /// Listens at the first free port of ten.
    pub(crate) fn bind(address: IpAddr, first_port: u16, access: Access, obeys: bool) -> io::Result<Self> {
        let mut result = Err(io::ErrorKind::AddrInUse.into());
        for port in first_port..=first_port.saturating_add(PORTS - 1) {
            result = TcpListener::bind((address, port));
            if !matches!(&result, Err(error) if error.kind() == io::ErrorKind::AddrInUse) {
                break;
            }
        }
        let listener = result?;
        listener.set_nonblocking(true)?;
        Ok(Self { listener, access, obeys, connections: Vec::new(), served: Served::default() })
    }

    /// Where it listens.
    pub(crate) fn address(&self) -> io::Result<SocketAddr> {
        self.listener.local_addr()
    }

    /// What wakes the process.
    pub(crate) fn descriptors(&self) -> Vec<BorrowedFd<'_>> {
        let streams = self.connections.iter().filter_map(Connection::stream);
        std::iter::once(self.listener.as_fd()).chain(streams.map(TcpStream::as_fd)).collect()
    }

    /// Takes new connections and what the others say; the commands among it.
    pub(crate) fn advance(&mut self, now: Instant) -> Vec<Command> {
        self.accept(now);
        let site = Site { access: &self.access, obeys: self.obeys };
        let commands = self.connections.iter_mut().flat_map(|connection| connection.advance(site, now)).collect();
        self.connections.retain(|connection| !connection.is_over());
        commands
    }

    /// Sends everybody what he lacks.
    pub(crate) fn offer(&mut self, board: &Board, now: Instant) {
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
    pub(crate) fn watching(&self) -> usize {
        self.connections.iter().filter(|connection| connection.is_watching()).count()
    }

    /// Whether a stream has not taken everything yet.
    pub(crate) fn is_writing(&self) -> bool {
        self.connections.iter().any(Connection::is_writing)
    }

    /// Whether somebody who watches lacks something.
    pub(crate) fn is_behind(&self, board: &Board) -> bool {
        self.connections.iter().any(|connection| connection.is_behind(board))
    }

    /// Says to everybody that nothing more comes.
    pub(crate) fn bid_farewell(&mut self) {
        self.connections.iter_mut().for_each(Connection::bid_farewell);
    }

    fn accept(&mut self, now: Instant) {
        // No more at once than there are places: the heartbeat must not wait for a flood to end.
        for _ in 0..MOST_CONNECTIONS {
            let stream = match self.listener.accept() {
                Ok((stream, _)) => stream,
                Err(error) if error.kind() == io::ErrorKind::WouldBlock => return,
                // One connection that could not be made, or no descriptor left: the others go on.
                Err(error) => {
                    tracing::debug!("a connection was not taken: {error}");
                    return;
                }
            };
            // Small messages follow each other quickly; holding them back would only show them late.
            let ready = stream.set_nonblocking(true).and_then(|()| stream.set_nodelay(true));
            if ready.is_err() || self.connections.len() >= MOST_CONNECTIONS {
                self.served.turned_away += 1;
                continue;
            }
            self.connections.push(Connection::new(stream, now));
        }
    }
}
