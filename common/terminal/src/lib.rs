//! A pseudo-terminal that another program opens as if it were a robot's serial port.
#![cfg_attr(test, allow(clippy::unwrap_used, reason = "tests fail by panicking"))]

mod link;

use std::ffi::OsStr;
use std::io;
use std::os::fd::{AsFd, BorrowedFd, OwnedFd};
use std::os::unix::ffi::OsStrExt;
use std::path::{Path, PathBuf};

use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::fs::{Mode, OFlags};
use rustix::io::Errno;
use rustix::pty::OpenptFlags;
use rustix::termios::OptionalActions;

use link::Link;
pub use link::LinkError;

/// Most bytes read at once, so that a client that never stops sending does not occupy the loop of its process.
const MAX_READ: usize = 4096;

/// The robot's end of a pseudo-terminal, and the links by which clients find the other end.
///
/// The clients' end is held open here too, until it is [let go](Terminal::let_go): a client that leaves does not hang it up, as
/// unplugging a computer does not switch the robot off.
#[derive(Debug)]
pub struct Terminal {
    robot: OwnedFd,
    /// Holds the clients' end open.
    client: Option<OwnedFd>,
    device: PathBuf,
    links: Vec<Link>,
}

impl Terminal {
    /// Opens a pseudo-terminal in raw mode under `name`, a link that replaces an earlier one.
    ///
    /// # Errors
    /// When the system has no pseudo-terminal to give, or the link cannot be made.
    pub fn open(name: PathBuf) -> Result<Self, LinkError> {
        let mut terminal = Self::without_link().map_err(|source| LinkError::Terminal { source })?;
        terminal.link(name)?;
        Ok(terminal)
    }

    fn without_link() -> io::Result<Self> {
        let robot = rustix::pty::openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY | OpenptFlags::CLOEXEC)?;
        rustix::pty::grantpt(&robot)?;
        rustix::pty::unlockpt(&robot)?;
        rustix::io::ioctl_fionbio(&robot, true)?;
        let device = rustix::pty::ptsname(&robot, Vec::new())?;
        let client = rustix::fs::open(&*device, OFlags::RDWR | OFlags::NOCTTY | OFlags::CLOEXEC, Mode::empty())?;
        let mut line = rustix::termios::tcgetattr(&client)?;
        line.make_raw();
        rustix::termios::tcsetattr(&client, OptionalActions::Now, &line)?;
        let device = Path::new(OsStr::from_bytes(device.to_bytes())).to_owned();
        Ok(Self { robot, client: Some(client), device, links: Vec::new() })
    }

    /// Adds a link by which clients find the terminal. It replaces an earlier link, and nothing else.
    ///
    /// # Errors
    /// When something that is no link is there, or the link cannot be made.
    pub fn link(&mut self, name: PathBuf) -> Result<(), LinkError> {
        self.links.push(Link::make(&self.device, name)?);
        Ok(())
    }

    /// Lets the terminal hang up when no client has it open, so that [`Terminal::is_visited`] shows it. It stays raw.
    pub fn let_go(&mut self) {
        self.client = None;
    }

    /// Whether a program has the clients' end open; always when the terminal was not [let go](Terminal::let_go).
    ///
    /// # Errors
    /// When the system refuses to look.
    pub fn is_visited(&self) -> io::Result<bool> {
        let mut ready = [PollFd::new(&self.robot, PollFlags::IN)];
        poll(&mut ready, Some(&Timespec::default()))?;
        Ok(!ready[0].revents().contains(PollFlags::HUP))
    }

    /// Becomes readable when a client has sent something, and while the terminal is hung up.
    pub fn descriptor(&self) -> BorrowedFd<'_> {
        self.robot.as_fd()
    }

    /// The bytes that wait from a client, none or some.
    ///
    /// # Errors
    /// When the terminal fails.
    pub fn read(&self) -> io::Result<Vec<u8>> {
        let mut bytes = vec![0; MAX_READ];
        let count = match rustix::io::read(&self.robot, &mut bytes) {
            Ok(count) => count,
            // EIO: it is hung up.
            Err(Errno::AGAIN | Errno::INTR | Errno::IO) => 0,
            Err(error) => return Err(error.into()),
        };
        bytes.truncate(count);
        Ok(bytes)
    }

    /// Sends to the clients. Bytes that do not fit, because no client reads, are lost, as on a serial line. Returns their number.
    ///
    /// # Errors
    /// When the terminal fails.
    pub fn write(&self, mut bytes: &[u8]) -> io::Result<usize> {
        while !bytes.is_empty() {
            match rustix::io::write(&self.robot, bytes) {
                Ok(count) => bytes = bytes.get(count..).unwrap_or_default(),
                Err(Errno::INTR) => {}
                Err(Errno::AGAIN) => return Ok(bytes.len()),
                Err(error) => return Err(error.into()),
            }
        }
        Ok(0)
    }

    /// Replaces the pseudo-terminal by a new one under the same links, so that what the last client left unread is not for the next.
    ///
    /// # Errors
    /// When the system has no other pseudo-terminal to give, or a link cannot be made; the old one remains.
    pub fn renew(&mut self) -> Result<(), LinkError> {
        let mut new = Self::without_link().map_err(|source| LinkError::Terminal { source })?;
        if self.client.is_none() {
            new.let_go();
        }
        self.links.iter().try_for_each(|link| new.link(link.name().to_owned()))?;
        *self = new;
        Ok(())
    }

    /// Whether clients have read everything that has reached their end; bytes written a moment ago may still be on their way.
    ///
    /// # Errors
    /// When the terminal fails.
    pub fn is_drained(&self) -> io::Result<bool> {
        Ok(self.client.as_ref().map_or(Ok(0), rustix::io::ioctl_fionread)? == 0)
    }
}

#[cfg(test)]
mod tests {
    use std::fs;
    use std::io::{Read, Write};

    use super::*;

    fn client(name: &Path) -> fs::File {
        fs::OpenOptions::new().read(true).write(true).open(name).unwrap()
    }

    fn wait(terminal: &Terminal) {
        poll(&mut [PollFd::from_borrowed_fd(terminal.descriptor(), PollFlags::IN)], None).unwrap();
    }

    #[test]
    fn bytes_pass_unchanged_and_survive_a_leaving_client() {
        let folder = tempfile::tempdir().unwrap();
        let name = folder.path().join("robot");
        let terminal = Terminal::open(name.clone()).unwrap();
        let every_byte: Vec<u8> = (0..=255).collect();
        for _ in 0..3 {
            let mut client = client(&name);
            client.write_all(&every_byte).unwrap();
            let mut received = Vec::new();
            while received.len() < every_byte.len() {
                wait(&terminal);
                received.extend(terminal.read().unwrap());
            }
            assert_eq!(received, every_byte);
            assert_eq!(terminal.write(&every_byte).unwrap(), 0);
            let mut taken = vec![0; every_byte.len()];
            client.read_exact(&mut taken).unwrap();
            assert_eq!(taken, every_byte);
            assert!(terminal.is_drained().unwrap());
        }
        assert!(terminal.read().unwrap().is_empty(), "nothing waits, and nothing blocks");
    }

    #[test]
    fn bytes_that_no_client_reads_are_lost_and_counted() {
        let folder = tempfile::tempdir().unwrap();
        let name = folder.path().join("robot");
        let terminal = Terminal::open(name.clone()).unwrap();
        let lost: usize = (0..100).map(|_| terminal.write(&[7; 1000]).unwrap()).sum();
        assert!(lost > 50_000, "{lost} of 100000 bytes");
        let client = client(&name);
        poll(&mut [PollFd::new(&client, PollFlags::IN)], None).unwrap();
        assert!(!terminal.is_drained().unwrap());
    }

    #[test]
    fn a_renewed_terminal_has_the_same_links_and_no_old_bytes() {
        let folder = tempfile::tempdir().unwrap();
        let name = folder.path().join("robot");
        let mut terminal = Terminal::open(name.clone()).unwrap();
        terminal.let_go();
        terminal.write(b"old").unwrap();
        terminal.renew().unwrap();
        assert!(!terminal.is_visited().unwrap());
        let mut client = client(&name);
        assert_eq!(terminal.write(b"new").unwrap(), 0);
        let mut bytes = [0; 3];
        client.read_exact(&mut bytes).unwrap();
        assert_eq!(&bytes, b"new");
    }

    #[test]
    fn a_later_terminal_replaces_the_link() {
        let folder = tempfile::tempdir().unwrap();
        let name = folder.path().join("robot");
        std::os::unix::fs::symlink("/dev/null/gone", &name).unwrap();
        let terminal = Terminal::open(name.clone()).unwrap();
        client(&name).write_all(b"x").unwrap();
        wait(&terminal);
        assert_eq!(terminal.read().unwrap(), b"x");
        drop(terminal);
        assert!(!name.exists() && fs::read_dir(folder.path()).unwrap().next().is_none());
    }

    #[test]
    fn a_terminal_that_is_let_go_shows_its_visitors() {
        let folder = tempfile::tempdir().unwrap();
        let name = folder.path().join("robot");
        let mut terminal = Terminal::open(name.clone()).unwrap();
        assert!(terminal.is_visited().unwrap(), "it is held open");
        terminal.let_go();
        for _ in 0..2 {
            assert!(!terminal.is_visited().unwrap() && terminal.read().unwrap().is_empty());
            let (mut first, second) = (client(&name), client(&name));
            assert!(terminal.is_visited().unwrap());
            drop(second);
            assert!(terminal.is_visited().unwrap());
            first.write_all(b"\n\r\x03").unwrap();
            wait(&terminal);
            assert_eq!(terminal.read().unwrap(), b"\n\r\x03", "it stays raw");
        }
    }
}
