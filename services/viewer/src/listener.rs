//! A port that is listened at.

use std::io;
use std::net::{IpAddr, SocketAddr, TcpListener, TcpStream};
use std::os::fd::{AsFd, BorrowedFd};
use std::time::{Duration, Instant};

/// Ports tried, from the first on.
const PORTS: u16 = 10;
/// Time until ports that were all taken are tried again.
pub const RETRY: Duration = Duration::from_secs(2);
/// Most connections taken at once: the heartbeat must not wait for a flood to end.
const ACCEPTED_AT_ONCE: usize = 32;

/// A port that is opened as soon as it can be had.
pub struct Listener {
    /// What is served there, in words.
    what: &'static str,
    address: IpAddr,
    first_port: u16,
    open: Option<(TcpListener, SocketAddr)>,
    /// Why it is not open.
    trouble: String,
    tried: Option<Instant>,
}

impl Listener {
    /// To serve this at the first free port of ten.
    pub fn new(what: &'static str, address: IpAddr, first_port: u16) -> Self {
        Self { what, address, first_port, open: None, trouble: String::new(), tried: None }
    }

    /// Opens the port, now and then, until it is open; true when it has just been.
    pub fn open(&mut self, now: Instant) -> bool {
        if self.open.is_some() || self.tried.is_some_and(|tried| now.saturating_duration_since(tried) < RETRY) {
            return false;
        }
        match self.bind() {
            Ok(open) => {
                tracing::debug!("{} is at {}", self.what, open.1);
                self.trouble.clear();
                self.open = Some(open);
            }
            Err(error) => {
                let trouble = format!("no {}: {}, port {} and the next nine: {error}", self.what, self.address, self.first_port);
                if self.trouble != trouble {
                    tracing::warn!("{trouble}");
                    self.trouble = trouble;
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

    /// Where it is open.
    pub fn address(&self) -> Option<SocketAddr> {
        self.open.as_ref().map(|(_, address)| *address)
    }

    /// Why it is not.
    pub fn trouble(&self) -> &str {
        &self.trouble
    }

    /// What tells that somebody has come.
    pub fn descriptor(&self) -> Option<BorrowedFd<'_>> {
        self.open.as_ref().map(|(listener, _)| listener.as_fd())
    }

    /// Takes who has come, as streams that do not block.
    pub fn accept(&self) -> Vec<TcpStream> {
        let mut streams = Vec::new();
        let Some((listener, _)) = &self.open else { return streams };
        for _ in 0..ACCEPTED_AT_ONCE {
            // Small messages follow each other quickly; holding them back would only show them late.
            let made_ready = |stream: TcpStream| stream.set_nonblocking(true).and_then(|()| stream.set_nodelay(true)).map(|()| stream);
            match listener.accept().and_then(|(stream, _)| made_ready(stream)) {
                Ok(stream) => streams.push(stream),
                Err(error) if error.kind() == io::ErrorKind::WouldBlock => break,
                // One connection that could not be made, or no descriptor left: the others go on.
                Err(error) => {
                    tracing::debug!("a connection was not taken: {error}");
                    break;
                }
            }
        }
        streams
    }
}
