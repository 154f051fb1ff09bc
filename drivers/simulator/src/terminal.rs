//! A pseudo-terminal that a client opens as if it were the robot's serial port.

use std::ffi::OsStr;
use std::fs;
use std::io;
use std::os::fd::{AsFd, BorrowedFd, OwnedFd};
use std::os::unix::ffi::OsStrExt;
use std::path::{Path, PathBuf};

use rustix::fs::{Mode, OFlags};
use rustix::io::Errno;
use rustix::pty::OpenptFlags;
use rustix::termios::OptionalActions;

/// Most bytes taken from a client at once: a client that never stops sending must not keep the world from going on.
const MOST_AT_ONCE: usize = 4096;

/// The robot's end of a pseudo-terminal, and the name by which clients find the other end.
///
/// The clients' end is held open here too: a client that leaves does not hang it up, as unplugging a computer does not
/// switch the robot off.
#[derive(Debug)]
pub struct Terminal {
    robot: OwnedFd,
    client: OwnedFd,
    name: PathBuf,
}

impl Terminal {
    /// Opens a pseudo-terminal in raw mode under `name`, a link that takes the place of an earlier one.
    ///
    /// # Errors
    /// When the system has no pseudo-terminal to give, or the link cannot be made.
    pub fn open(name: PathBuf) -> io::Result<Self> {
        let robot = rustix::pty::openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY | OpenptFlags::CLOEXEC)?;
        rustix::pty::grantpt(&robot)?;
        rustix::pty::unlockpt(&robot)?;
        rustix::io::ioctl_fionbio(&robot, true)?;
        let device = rustix::pty::ptsname(&robot, Vec::new())?;
        let client = rustix::fs::open(&*device, OFlags::RDWR | OFlags::NOCTTY | OFlags::CLOEXEC, Mode::empty())?;
        let mut line = rustix::termios::tcgetattr(&client)?;
        line.make_raw();
        rustix::termios::tcsetattr(&client, OptionalActions::Now, &line)?;
        link(Path::new(OsStr::from_bytes(device.to_bytes())), &name)?;
        Ok(Self { robot, client, name })
    }

    /// Becomes readable when a client has sent something.
    pub fn descriptor(&self) -> BorrowedFd<'_> {
        self.robot.as_fd()
    }

    /// The bytes that wait from a client, none or some.
    ///
    /// # Errors
    /// When the terminal fails.
    pub fn read(&self) -> io::Result<Vec<u8>> {
        let mut bytes = vec![0; MOST_AT_ONCE];
        let count = match rustix::io::read(&self.robot, &mut bytes) {
            Ok(count) => count,
            Err(Errno::AGAIN | Errno::INTR) => 0,
            Err(error) => return Err(error.into()),
        };
        bytes.truncate(count);
        Ok(bytes)
    }

    /// Sends to whoever listens. What does not fit any more, because nobody does, is lost, as on a serial line; returns how many
    /// bytes that were.
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

    /// Whether clients have taken everything that has reached their end; what was written a moment ago may be on its way still.
    ///
    /// # Errors
    /// When the terminal fails.
    pub fn is_drained(&self) -> io::Result<bool> {
        Ok(rustix::io::ioctl_fionread(&self.client)? == 0)
    }
}

impl Drop for Terminal {
    fn drop(&mut self) {
        if let Err(error) = fs::remove_file(&self.name) {
            tracing::debug!("{} is left behind: {error}", self.name.display());
        }
    }
}

/// Makes the link under another name first: at no moment does a client find none.
fn link(device: &Path, name: &Path) -> io::Result<()> {
    let fresh = name.with_extension("fresh");
    match fs::remove_file(&fresh) {
        Err(error) if error.kind() != io::ErrorKind::NotFound => return Err(error),
        _ => {}
    }
    std::os::unix::fs::symlink(device, &fresh)?;
    fs::rename(&fresh, name)
}

#[cfg(test)]
mod tests {
    use std::io::{Read, Write};

    use rustix::event::{PollFd, PollFlags, poll};

    use super::*;

    fn client(name: &Path) -> fs::File {
        fs::OpenOptions::new().read(true).write(true).open(name).unwrap()
    }

    fn wait(terminal: &Terminal) {
        poll(&mut [PollFd::from_borrowed_fd(terminal.descriptor(), PollFlags::IN)], None).unwrap();
    }

    #[test]
    fn bytes_pass_unchanged_both_ways_and_a_leaving_client_does_no_harm() {
        let folder = tempfile::tempdir().unwrap();
        let name = folder.path().join("robot");
        let terminal = Terminal::open(name.clone()).unwrap();
        let every_byte: Vec<u8> = (0..=255).collect();
        for _ in 0..3 {
            let mut client = client(&name);
            client.write_all(&every_byte).unwrap();
            let mut heard = Vec::new();
            while heard.len() < every_byte.len() {
                wait(&terminal);
                heard.extend(terminal.read().unwrap());
            }
            assert_eq!(heard, every_byte);
            assert_eq!(terminal.write(&every_byte).unwrap(), 0);
            let mut taken = vec![0; every_byte.len()];
            client.read_exact(&mut taken).unwrap();
            assert_eq!(taken, every_byte);
            assert!(terminal.is_drained().unwrap());
        }
        assert!(terminal.read().unwrap().is_empty(), "nothing waits, and nothing blocks");
    }

    #[test]
    fn what_nobody_takes_is_lost_and_counted() {
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
    fn a_later_terminal_takes_the_name_over() {
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
}
