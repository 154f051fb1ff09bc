//! The serial port, never waited for: the loop around it waits for all of its inputs at once.

use std::io::{self, Read, Write};
use std::os::fd::{AsRawFd, BorrowedFd};
use std::path::Path;
use std::time::Duration;

use serialport::{ClearBuffer, SerialPort, TTYPort};

/// An open port: raw, 8 data bits, no parity, 1 stop bit, no flow control.
#[derive(Debug)]
pub struct Port {
    tty: TTYPort,
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
        Ok(Self { tty })
    }

    /// Sets the baud rate and drops what waits to be read.
    ///
    /// # Errors
    /// When the device refuses.
    pub fn set_baud(&mut self, baud: u32) -> serialport::Result<()> {
        self.tty.set_baud_rate(baud)?;
        self.flush()
    }

    /// Drops what waits to be read.
    ///
    /// # Errors
    /// When the device refuses.
    pub fn flush(&self) -> serialport::Result<()> {
        self.tty.clear(ClearBuffer::Input)
    }

    /// Takes bytes that have come; 0 when there are none, or no room.
    ///
    /// # Errors
    /// When the device is gone.
    pub fn read(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
        if bytes.is_empty() {
            return Ok(0);
        }
        match self.tty.read(bytes) {
            Ok(0) => Err(io::Error::new(io::ErrorKind::UnexpectedEof, "hung up")),
            Err(error) if is_nothing(&error) => Ok(0),
            other => other,
        }
    }

    /// Sends a packet. When the line takes no bytes, because its other end reads none, the packet is lost: returns whether it went.
    ///
    /// # Errors
    /// When the device is gone.
    pub fn send(&mut self, packet: &[u8]) -> io::Result<bool> {
        match self.tty.write_all(packet) {
            Ok(()) => Ok(true),
            Err(error) if is_nothing(&error) => Ok(false),
            Err(error) => Err(error),
        }
    }

    /// Becomes readable when bytes come, or the device goes.
    pub fn descriptor(&self) -> BorrowedFd<'_> {
        // SAFETY: the port owns the descriptor and keeps it open as long as it lives, which the borrow outlasts not.
        #[expect(unsafe_code, reason = "serialport hands out the raw number only")]
        unsafe {
            BorrowedFd::borrow_raw(self.tty.as_raw_fd())
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
            let mut heard = Vec::new();
            while heard.len() < every.len() {
                let count = port.read(&mut bytes).unwrap();
                heard.extend_from_slice(&bytes[..count]);
            }
            assert_eq!(heard, every);
            assert!(port.send(&every).unwrap());
            let count = rustix::io::read(&robot, &mut bytes).unwrap();
            assert_eq!(&bytes[..count], every);
        }
    }

    #[test]
    fn a_port_that_nobody_reads_loses_commands_and_hangs_nobody() {
        let (_robot, path) = pseudo_terminal();
        let mut port = Port::open(&path, 9600).unwrap();
        let went = (0..10_000).take_while(|_| port.send(&[0xFA, 0xFB, 3, 0, 0, 0]).unwrap()).count();
        assert!((10..10_000).contains(&went), "{went}");
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
