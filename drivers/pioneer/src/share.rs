//! Ports on which another program uses the robot as if it were connected to it.
//!
//! Whole packets pass from the program to the robot; whatever else it sends is dropped and counted. All bytes of the robot pass to
//! the program as far as it reads them. One program commands at a time.

use std::io::{self, Read, Write};
use std::net::{Ipv4Addr, TcpListener, TcpStream};
use std::os::fd::{AsFd, BorrowedFd};
use std::path::PathBuf;
use std::time::{Duration, Instant};

use psos::Deframer;
use terminal::{LinkError, Terminal};

/// Most bytes taken from a program at once: one that never stops sending must not occupy the driver.
const MAX_READ: usize = 4096;

/// A program that has sent nothing for this long may be replaced by another: the robot's watchdog has stopped the robot by then.
const COMMANDS_FOR: Duration = Duration::from_secs(2);

/// Fewer bytes outside of packets than this are not reported: real clients send a few for a modem before they connect.
const REPORTED_NOISE: u64 = 64;

/// A shared port that cannot be opened.
#[derive(Debug, thiserror::Error)]
pub enum ShareError {
    /// The pseudo-terminal or its link cannot be made.
    #[error("{0}")]
    Terminal(#[from] LinkError),
    /// The TCP port cannot be opened.
    #[error("TCP port {port}: {source}")]
    Listen {
        /// The port.
        port: u16,
        /// Why.
        source: io::Error,
    },
}

/// What came from the programs on the shared ports.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Shared {
    /// The data of a packet for the robot.
    Command(Vec<u8>),
    /// The program that commanded the robot has left.
    Left,
    /// Something to report.
    Remark(String),
}

/// The shared ports of a driver.
#[derive(Debug, Default)]
pub struct Share {
    ports: Vec<SharedPort>,
    /// Which port's program commands, and when it sent its last packet.
    commands: Option<(usize, Instant)>,
    /// Packets of programs that did not command.
    ignored: u64,
    remarks: Vec<String>,
}

#[derive(Debug)]
struct SharedPort {
    name: String,
    channel: Channel,
    deframer: Deframer,
    /// Chunks of the robot's bytes that the program did not read.
    unread: u64,
    /// Bytes outside of packets that have been reported.
    reported_noise: u64,
}

#[derive(Debug)]
enum Channel {
    Terminal { terminal: Terminal, visited: bool },
    Network { listener: TcpListener, client: Option<TcpStream>, refused: u64 },
}

impl Share {
    /// Opens a pseudo-terminal under `link` and a TCP port of the loopback interface, as far as they are given; port 0 is any.
    ///
    /// # Errors
    /// When one of them cannot be opened.
    pub fn open(link: Option<PathBuf>, port: Option<u16>) -> Result<Self, ShareError> {
        let mut share = Self::default();
        if let Some(link) = link {
            let name = link.display().to_string();
            let mut terminal = Terminal::open(link)?;
            terminal.let_go();
            share.add(name, Channel::Terminal { terminal, visited: false });
        }
        if let Some(port) = port {
            let open = || {
                let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, port))?;
                listener.set_nonblocking(true)?;
                Ok((listener.local_addr()?.to_string(), listener))
            };
            let (name, listener) = open().map_err(|source| ShareError::Listen { port, source })?;
            share.add(name, Channel::Network { listener, client: None, refused: 0 });
        }
        Ok(share)
    }

    fn add(&mut self, name: String, channel: Channel) {
        self.ports.push(SharedPort { name, channel, deframer: Deframer::new(), unread: 0, reported_noise: 0 });
    }

    /// The ports' names: the link of the pseudo-terminal, the address of the TCP port.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.ports.iter().map(|port| port.name.as_str())
    }

    /// Become readable when a program connects, sends or leaves. A pseudo-terminal that no program has open is looked at by
    /// [`Share::read`] alone.
    pub fn descriptors(&self) -> impl Iterator<Item = BorrowedFd<'_>> {
        self.ports
            .iter()
            .flat_map(|port| match &port.channel {
                Channel::Terminal { terminal, visited } => [visited.then(|| terminal.descriptor()), None],
                Channel::Network { listener, client, .. } => [Some(listener.as_fd()), client.as_ref().map(AsFd::as_fd)],
            })
            .flatten()
    }

    /// Takes what has come from the programs, in order.
    pub fn read(&mut self, now: Instant) -> Vec<Shared> {
        let mut taken: Vec<Shared> = self.remarks.drain(..).map(Shared::Remark).collect();
        for index in 0..self.ports.len() {
            self.read_port(index, now, &mut taken);
        }
        taken
    }

    fn read_port(&mut self, index: usize, now: Instant, taken: &mut Vec<Shared>) {
        let Some(port) = self.ports.get_mut(index) else { return };
        let (bytes, left) = port.channel.read(&port.name, taken);
        for frame in port.deframer.push(&bytes) {
            match self.commands {
                Some((other, spoke)) if other != index && now.duration_since(spoke) < COMMANDS_FOR => {
                    self.ignored += 1;
                    if self.ignored.is_power_of_two() {
                        let (name, times) = (&port.name, self.ignored);
                        taken.push(Shared::Remark(format!("a command from {name} is ignored ({times} so far): another program commands")));
                    }
                }
                _ => {
                    self.commands = Some((index, now));
                    taken.push(Shared::Command(frame.data));
                }
            }
        }
        taken.extend(port.noise().map(Shared::Remark));
        if left {
            port.deframer.flush();
            if self.commands.take_if(|(commands, _)| *commands == index).is_some() {
                taken.push(Shared::Left);
            }
        }
    }

    /// Gives bytes of the robot to the programs, as far as they read them.
    pub fn write(&mut self, bytes: &[u8]) {
        for port in &mut self.ports {
            if port.channel.write(bytes) == 0 {
                continue;
            }
            port.unread += 1;
            if port.unread.is_power_of_two() {
                let (name, times) = (&port.name, port.unread);
                self.remarks.push(format!("the program on {name} does not read: packets of the robot are lost to it ({times} so far)"));
            }
        }
    }
}

impl SharedPort {
    /// A remark where the bytes outside of packets have doubled.
    fn noise(&mut self) -> Option<String> {
        let noise = self.deframer.counters().skipped_bytes;
        if noise < REPORTED_NOISE.max(2 * self.reported_noise) {
            return None;
        }
        self.reported_noise = noise;
        Some(format!("the program on {} sends bytes that are no packets ({noise} so far): they are dropped", self.name))
    }
}

impl Channel {
    /// The bytes that have come, and whether the program has left.
    fn read(&mut self, name: &str, taken: &mut Vec<Shared>) -> (Vec<u8>, bool) {
        match self {
            Self::Terminal { terminal, visited } => {
                let bytes = terminal.read().unwrap_or_default();
                // After the bytes: what a program sent before it left counts. It may have come, sent and left between two looks.
                let is_visited = terminal.is_visited().unwrap_or(false);
                let was_visited = std::mem::replace(visited, is_visited);
                if was_visited
                    && !is_visited
                    && let Err(error) = terminal.renew()
                {
                    taken.push(Shared::Remark(error.to_string()));
                }
                (bytes, !is_visited)
            }
            Self::Network { listener, client, refused } => {
                while let Ok((connection, _)) = listener.accept() {
                    if client.is_none() && connection.set_nonblocking(true).and_then(|()| connection.set_nodelay(true)).is_ok() {
                        *client = Some(connection);
                        continue;
                    }
                    *refused += 1;
                    if refused.is_power_of_two() {
                        taken.push(Shared::Remark(format!("a second program on {name} is turned away ({refused} so far)")));
                    }
                }
                let Some(connection) = client else { return (Vec::new(), false) };
                let mut bytes = vec![0; MAX_READ];
                let count = match connection.read(&mut bytes) {
                    Ok(count) if count > 0 => count,
                    Err(error) if matches!(error.kind(), io::ErrorKind::WouldBlock | io::ErrorKind::Interrupted) => 0,
                    Ok(_) | Err(_) => {
                        *client = None;
                        return (Vec::new(), true);
                    }
                };
                bytes.truncate(count);
                (bytes, false)
            }
        }
    }

    /// Returns how many bytes a program that is there did not take. An error shows with the next read.
    fn write(&mut self, bytes: &[u8]) -> usize {
        match self {
            Self::Terminal { terminal, visited: true } => terminal.write(bytes).unwrap_or_default(),
            Self::Network { client: Some(client), .. } => match client.write(bytes) {
                Ok(count) => bytes.len().saturating_sub(count),
                Err(error) if error.kind() == io::ErrorKind::WouldBlock => bytes.len(),
                Err(_) => 0,
            },
            Self::Terminal { .. } | Self::Network { .. } => 0,
        }
    }
}
