//! Opening a port. A connection in the network is made in a thread, since the resolver blocks for as long as it likes.

use std::io;
use std::net::{TcpStream, ToSocketAddrs};
use std::path::PathBuf;
use std::sync::mpsc::{Receiver, TryRecvError, channel};
use std::thread;
use std::time::Duration;

use crate::address::Address;
use crate::port::{Port, words};

/// How long one address may take to accept a connection. A Wi-Fi bridge that wakes up takes about a second.
const ACCEPT: Duration = Duration::from_secs(5);

/// A port that cannot be opened.
#[derive(Debug, thiserror::Error)]
pub enum OpenError {
    /// The serial device cannot be opened.
    #[error("{}: {}", path.display(), words(source))]
    Serial {
        /// The device.
        path: PathBuf,
        /// Why.
        source: serialport::Error,
    },
    /// No address belongs to the host's name.
    #[error("{address}: the host's name has no address ({source})")]
    Unknown {
        /// The port.
        address: Address,
        /// What the resolver says.
        source: io::Error,
    },
    /// The host refuses.
    #[error("{address}: connection refused: does the simulator or bridge run there, and listen on this port?")]
    Refused {
        /// The port.
        address: Address,
    },
    /// The host does not answer.
    #[error("{address}: no answer within {} s: is the host switched on and in this network?", ACCEPT.as_secs())]
    Silent {
        /// The port.
        address: Address,
    },
    /// The connection fails otherwise.
    #[error("{address}: cannot connect: {source}")]
    Connect {
        /// The port.
        address: Address,
        /// Why.
        source: io::Error,
    },
}

/// A port that is being opened.
#[derive(Debug)]
pub struct Opening {
    address: Address,
    made: Receiver<Result<Port, OpenError>>,
}

impl Opening {
    /// Starts to open a port; a serial device with this speed.
    #[must_use]
    pub fn start(address: &Address, baud: u32) -> Self {
        let (send, made) = channel();
        match address {
            Address::Device(path) => {
                let port = Port::open(path, baud).map_err(|source| OpenError::Serial { path: path.clone(), source });
                // The receiver is at hand.
                let _ = send.send(port);
            }
            Address::Network { host, port } => {
                let (host, port, target) = (host.clone(), *port, address.clone());
                // The port is dropped when the driver has ended meanwhile. A thread that cannot start reports itself by its absence.
                let connect = move || drop(send.send(connect(&target, &host, port)));
                let _ = thread::Builder::new().name("connect".to_owned()).spawn(connect);
            }
        }
        Self { address: address.clone(), made }
    }

    /// The port once it is open, or why it cannot be opened; `None` while neither is known.
    pub fn poll(&self) -> Option<Result<Port, OpenError>> {
        match self.made.try_recv() {
            Ok(made) => Some(made),
            Err(TryRecvError::Empty) => None,
            Err(TryRecvError::Disconnected) => Some(Err(self.no_thread())),
        }
    }

    /// Waits for the port.
    ///
    /// # Errors
    /// When it cannot be opened.
    pub fn wait(self) -> Result<Port, OpenError> {
        self.made.recv().unwrap_or_else(|_| Err(self.no_thread()))
    }

    fn no_thread(&self) -> OpenError {
        OpenError::Connect { address: self.address.clone(), source: io::Error::other("the system gives no thread") }
    }
}

/// Connects to the first address of the host that accepts.
fn connect(address: &Address, host: &str, port: u16) -> Result<Port, OpenError> {
    let known = (host, port).to_socket_addrs().map_err(|source| OpenError::Unknown { address: address.clone(), source })?;
    let mut failed = io::Error::other("none");
    for target in known {
        let made = TcpStream::connect_timeout(&target, ACCEPT).and_then(Port::network);
        match made {
            Ok(port) => return Ok(port),
            Err(error) => failed = error,
        }
    }
    let address = address.clone();
    Err(match failed.kind() {
        io::ErrorKind::ConnectionRefused => OpenError::Refused { address },
        io::ErrorKind::TimedOut | io::ErrorKind::WouldBlock => OpenError::Silent { address },
        _ => OpenError::Connect { address, source: failed },
    })
}

#[cfg(test)]
mod tests {
    use std::net::TcpListener;

    use super::*;

    fn network(host: &str, port: u16) -> Address {
        Address::Network { host: host.to_owned(), port }
    }

    fn refused(address: &Address) -> String {
        Opening::start(address, 9600).wait().unwrap_err().to_string()
    }

    #[test]
    fn a_connection_is_made_over_ipv4_and_ipv6() {
        for (bind, host) in [("127.0.0.1:0", "127.0.0.1"), ("127.0.0.1:0", "localhost"), ("[::1]:0", "::1")] {
            // A machine without IPv6 has nothing to test.
            let Ok(listener) = TcpListener::bind(bind) else { continue };
            let port = listener.local_addr().unwrap().port();
            assert!(Opening::start(&network(host, port), 9600).wait().is_ok(), "{host}");
        }
    }

    #[test]
    fn a_port_without_a_listener_is_refused_by_name() {
        let port = TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port();
        let expect =
            format!("tcp://127.0.0.1:{port}: connection refused: does the simulator or bridge run there, and listen on this port?");
        assert_eq!(refused(&network("127.0.0.1", port)), expect);
    }

    #[test]
    fn a_name_without_an_address_is_named() {
        let error = refused(&network("no-such-host.invalid", 8101));
        assert!(error.starts_with("tcp://no-such-host.invalid:8101: the host's name has no address ("), "{error}");
    }

    #[test]
    fn a_missing_device_is_named() {
        let error = refused(&Address::Device("/dev/no-such-port".into()));
        assert!(error.starts_with("/dev/no-such-port: no such device"), "{error}");
    }
}
