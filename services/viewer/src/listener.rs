//! A listening socket.

use std::io;
use std::net::{IpAddr, SocketAddr, TcpListener, TcpStream};
use std::os::fd::{AsFd, BorrowedFd};
use std::time::{Duration, Instant};

/// Number of ports to try, from the first one.
const PORTS: u16 = 10;
/// Time until the ports are tried again if all were taken.
pub const RETRY: Duration = Duration::from_secs(2);
/// Most connections accepted in one step, so that a flood does not delay the heartbeat.
const ACCEPTED_AT_ONCE: usize = 32;

/// A socket that is opened as soon as a port is free.
pub struct Listener {
    /// What it serves, for log lines.
    what: &'static str,
    address: IpAddr,
    first_port: u16,
    open: Option<(TcpListener, SocketAddr)>,
    /// Why it is not open.
    problem: String,
    tried: Option<Instant>,
}

impl Listener {
    /// A listener at the first free port of ten.
    pub fn new(what: &'static str, address: IpAddr, first_port: u16) -> Self {
        Self { what, address, first_port, open: None, problem: String::new(), tried: None }
    }

    /// Tries to open the socket, if it is not open and a try is due; true if it was opened now.
    pub fn open(&mut self, now: Instant) -> bool {
        if self.open.is_some() || self.tried.is_some_and(|tried| now.saturating_duration_since(tried) < RETRY) {
            return false;
        }
        match self.bind() {
            Ok(open) => {
                tracing::debug!("{} at {}", self.what, open.1);
                self.problem.clear();
                self.open = Some(open);
            }
            Err(error) => {
                let problem = format!("no {}: {}, port {} and the next nine: {error}", self.what, self.address, self.first_port);
                if self.problem != problem {
                    tracing::warn!("{problem}");
                    self.problem = problem;
                }
                self.tried = Some(now);
            }
        }
        self.open.is_some()
    }

    fn bind(&self) -> io::Result<(TcpListener, SocketAddr)> {
        let mut result = Err(io::ErrorKind::AddrInUse.into());
        for port in self.first_port..=self.first_port.saturating_add(PORTS - 1) {
            result = TcpListener::bind((self.address, port));
            if !matches!(&result, Err(error) if error.kind() == io::ErrorKind::AddrInUse) {
                break;
            }
        }
        let listener = result?;
        listener.set_nonblocking(true)?;
        listener.local_addr().map(|address| (listener, address))
    }

    /// Its address, once it is open.
    pub fn address(&self) -> Option<SocketAddr> {
        self.open.as_ref().map(|(_, address)| *address)
    }

    /// Why it is not open.
    pub fn problem(&self) -> &str {
        &self.problem
    }

    /// The descriptor that is readable when a connection waits.
    pub fn descriptor(&self) -> Option<BorrowedFd<'_>> {
        self.open.as_ref().map(|(listener, _)| listener.as_fd())
    }

    /// Accepts the waiting connections as non-blocking streams.
    pub fn accept(&self) -> Vec<TcpStream> {
        let mut streams = Vec::new();
        let Some((listener, _)) = &self.open else { return streams };
        for _ in 0..ACCEPTED_AT_ONCE {
            // Without a delay: small messages follow each other quickly.
            let configured = |stream: TcpStream| stream.set_nonblocking(true).and_then(|()| stream.set_nodelay(true)).map(|()| stream);
            match listener.accept().and_then(|(stream, _)| configured(stream)) {
                Ok(stream) => streams.push(stream),
                Err(error) if error.kind() == io::ErrorKind::WouldBlock => break,
                // The connection was aborted, or no descriptor is left: the open connections are not affected.
                Err(error) => {
                    tracing::debug!("a connection was not accepted: {error}");
                    break;
                }
            }
        }
        streams
    }
}
