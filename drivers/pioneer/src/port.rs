//! The line to the robot, never waited for: the loop around it waits for all of its inputs at once.

use std::io::{self, Read, Write};
use std::net::TcpStream;
use std::os::fd::{AsFd, AsRawFd, BorrowedFd};
use std::path::Path;
use std::time::Duration;

use serialport::{ClearBuffer, SerialPort, TTYPort};

/// An open port: a serial line (raw, 8 data bits, no parity, 1 stop bit, no flow control), or a connection in the network.
#[derive(Debug)]
pub struct Port {
    line: Line,
    /// The end of a packet that the line has taken in part.
    unsent: Vec<u8>,
}

#[derive(Debug)]
enum Line {
    Serial(TTYPort),
    Network(TcpStream),
}

impl Port {
    /// Opens a serial device, or a pseudo-terminal, which bears any baud rate and heeds none.
    ///
    /// # Errors
    /// When it is not there, may not be opened, or another program has it.
    pub fn open(path: &Path, baud: u32) -> serialport::Result<Self> {
        // A pseudo-terminal whose other end lives on would still be marked as taken after a kill.
        let device = std::fs::canonicalize(path).unwrap_or_else(|_| path.to_owned());
        let exclusive = !device.starts_with("/dev/pts");
        let tty = serialport::new(path.to_string_lossy(), baud).timeout(Duration::ZERO).exclusive(exclusive).open_native()?;
        Ok(Self { line: Line::Serial(tty), unsent: Vec::new() })
    }

    /// A port over a connection.
    ///
    /// # Errors
    /// When the connection cannot be set.
    pub(crate) fn network(connection: TcpStream) -> io::Result<Self> {
        connection.set_nonblocking(true)?;
        // A packet is six bytes: each is sent at once.
        connection.set_nodelay(true)?;
        Ok(Self { line: Line::Network(connection), unsent: Vec::new() })
    }

    /// Sets the baud rate and drops what waits to be read. A connection has no baud rate.
    ///
    /// # Errors
    /// When the device refuses.
    pub fn set_baud(&mut self, baud: u32) -> serialport::Result<()> {
        if let Line::Serial(tty) = &mut self.line {
            tty.set_baud_rate(baud)?;
        }
        self.flush()
    }

    /// Drops what waits to be read.
    ///
    /// # Errors
    /// When the device refuses.
    pub fn flush(&mut self) -> serialport::Result<()> {
        match &mut self.line {
            Line::Serial(tty) => tty.clear(ClearBuffer::Input),
            Line::Network(connection) => {
                let mut bytes = [0; 4096];
                // An end or an error shows again with the next read.
                while connection.read(&mut bytes).is_ok_and(|count| count == bytes.len()) {}
                Ok(())
            }
        }
    }

    /// Takes bytes that have come; 0 when there are none, or no room.
    ///
    /// # Errors
    /// When the device is gone.
    pub fn read(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
        if bytes.is_empty() {
            return Ok(0);
        }
        let read = match &mut self.line {
            Line::Serial(tty) => tty.read(bytes),
            Line::Network(connection) => connection.read(bytes),
        };
        match read {
            Ok(0) => Err(io::Error::new(io::ErrorKind::UnexpectedEof, "hung up")),
            Err(error) if is_nothing(&error) => Ok(0),
            other => other,
        }
    }

    /// Sends a packet, whole or not at all. When the line takes no bytes, because its other end reads none, the packet is lost:
    /// returns whether it was sent. The rest of a packet that was taken in part goes before the next one.
    ///
    /// # Errors
    /// When the device is gone.
    pub fn send(&mut self, packet: &[u8]) -> io::Result<bool> {
        let unsent = std::mem::take(&mut self.unsent);
        let taken = self.write(&unsent)?;
        if taken < unsent.len() {
            self.unsent = unsent.get(taken..).unwrap_or_default().to_vec();
            return Ok(false);
        }
        let taken = self.write(packet)?;
        if taken > 0 {
            self.unsent = packet.get(taken..).unwrap_or_default().to_vec();
        }
        Ok(taken > 0)
    }

    /// Writes as many bytes as the line takes; returns their number.
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let mut taken = 0;
        while let Some(rest) = bytes.get(taken..).filter(|rest| !rest.is_empty()) {
            let written = match &mut self.line {
                Line::Serial(tty) => tty.write(rest),
                Line::Network(connection) => connection.write(rest),
            };
            match written {
                Ok(0) => break,
                Ok(count) => taken += count,
                Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
                Err(error) if is_nothing(&error) => break,
                Err(error) => return Err(error),
            }
        }
        Ok(taken)
    }

    /// Becomes readable when bytes come, or the device goes.
    pub fn descriptor(&self) -> BorrowedFd<'_> {
        let tty = match &self.line {
            Line::Network(connection) => return connection.as_fd(),
            Line::Serial(tty) => tty,
        };
        // SAFETY: the port owns the descriptor and keeps it open as long as it lives, which the borrow outlasts not.
        #[expect(unsafe_code, reason = "serialport hands out the raw number only")]
        unsafe {
            BorrowedFd::borrow_raw(tty.as_raw_fd())
        }
    }
}

/// Why a port cannot be opened or set, in words that say what to do.
pub fn words(error: &serialport::Error) -> String {
    use serialport::ErrorKind::{Io, NoDevice, Unknown};
    match error.kind() {
        Io(io::ErrorKind::NotFound) => "no such device: is the adapter plugged in? `ls /dev/serial/by-id` shows what there is".to_owned(),
        Io(io::ErrorKind::PermissionDenied) => "permission denied: is this user in the group that may use it (dialout)?".to_owned(),
        NoDevice => "in use by another program".to_owned(),
        Unknown
            if ["Not a typewriter", "Inappropriate ioctl for device", "Is a directory"].iter().any(|&said| error.description == said) =>
        {
            "not a serial port".to_owned()
        }
        _ => error.to_string(),
    }
}

fn is_nothing(error: &io::Error) -> bool {
    matches!(error.kind(), io::ErrorKind::TimedOut | io::ErrorKind::WouldBlock | io::ErrorKind::Interrupted)
}

#[cfg(test)]
mod tests {
    use std::ffi::OsStr;
    use std::os::fd::OwnedFd;
    use std::os::unix::ffi::OsStrExt;

    use rustix::event::{PollFd, PollFlags, poll};
    use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};

    use super::*;

    fn pseudo_terminal() -> (OwnedFd, std::path::PathBuf) {
        let robot = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY).unwrap();
        grantpt(&robot).unwrap();
        unlockpt(&robot).unwrap();
        let name = ptsname(&robot, Vec::new()).unwrap();
        let path = Path::new(OsStr::from_bytes(name.to_bytes())).to_owned();
        (robot, path)
    }

    /// Waits for input as the loop around the port does.
    fn wait(port: &Port) {
        poll(&mut [PollFd::from_borrowed_fd(port.descriptor(), PollFlags::IN)], None).unwrap();
    }

    #[test]
    fn bytes_pass_both_ways_unchanged_at_any_baud_rate() {
        let (robot, path) = pseudo_terminal();
        let mut port = Port::open(&path, 9600).unwrap();
        let every: Vec<u8> = (0..=255).collect();
        let mut bytes = [0; 1024];
        for baud in [9600, 38400, 19200, 115_200, 57600] {
            port.set_baud(baud).unwrap();
            assert_eq!(port.read(&mut bytes).unwrap(), 0, "nothing waits");
            rustix::io::write(&robot, &every).unwrap();
            wait(&port);
            let mut received = Vec::new();
            while received.len() < every.len() {
                let count = port.read(&mut bytes).unwrap();
                received.extend_from_slice(&bytes[..count]);
            }
            assert_eq!(received, every);
            assert!(port.send(&every).unwrap());
            let count = rustix::io::read(&robot, &mut bytes).unwrap();
            assert_eq!(&bytes[..count], every);
        }
    }

    #[test]
    fn a_connection_that_is_not_read_loses_whole_packets_only() {
        let listener = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
        let mut port = Port::network(TcpStream::connect(listener.local_addr().unwrap()).unwrap()).unwrap();
        let (mut robot, _) = listener.accept().unwrap();
        let mut deframer = psos::Deframer::new();
        let mut bytes = vec![0; 1 << 16];
        for round in 0..20_u8 {
            let packet = psos::encode_frame(&[round; 190]).unwrap();
            while port.send(&packet).unwrap() {}
            let count = robot.read(&mut bytes).unwrap();
            deframer.push(&bytes[..count]);
        }
        drop(port);
        while let Ok(count @ 1..) = robot.read(&mut bytes) {
            deframer.push(&bytes[..count]);
        }
        let counters = deframer.counters();
        assert_eq!(counters.bad_checksums, 0, "{counters:?}");
        assert!(counters.packets > 1000 && counters.skipped_bytes < 195, "{counters:?}");
    }

    #[test]
    fn a_port_that_is_not_read_loses_whole_packets_only() {
        let (robot, path) = pseudo_terminal();
        let mut port = Port::open(&path, 9600).unwrap();
        let mut deframer = psos::Deframer::new();
        let mut sent = 0;
        for round in 0..20_u8 {
            let packet = psos::encode_frame(&[round; 190]).unwrap();
            sent += (0..1000).take_while(|_| port.send(&packet).unwrap()).count() as u64;
            let mut bytes = [0; 1000];
            let count = rustix::io::read(&robot, &mut bytes).unwrap();
            deframer.push(&bytes[..count]);
        }
        assert!(sent > 20, "{sent}");
        let counters = deframer.counters();
        assert_eq!((counters.bad_checksums, counters.skipped_bytes), (0, 0), "{counters:?}");
        assert!(counters.packets > 20, "{counters:?}");
    }

    #[test]
    fn a_port_that_goes_is_noticed() {
        let (robot, path) = pseudo_terminal();
        let mut port = Port::open(&path, 9600).unwrap();
        drop(robot);
        wait(&port);
        assert!(port.read(&mut [0; 16]).is_err());
        assert!(port.send(&[1]).is_err());
        assert!(Port::open(&path, 9600).is_err());
    }

    #[test]
    fn after_a_kill_a_pseudo_terminal_opens_again() {
        let (robot, path) = pseudo_terminal();
        let first = Port::open(&path, 9600).unwrap();
        std::mem::forget(first);
        rustix::io::write(&robot, b"waiting").unwrap();
        let mut second = Port::open(&path, 9600).unwrap();
        wait(&second);
        assert_eq!(second.read(&mut [0; 16]).unwrap(), 7, "what waits is not lost");
    }
}
