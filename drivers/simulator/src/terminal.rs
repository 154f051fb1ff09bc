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
pub(crate) struct Terminal {
    robot: OwnedFd,
    client: OwnedFd,
    name: PathBuf,
}

impl Terminal {
    /// Opens a pseudo-terminal in raw mode under `name`, a link that takes the place of an earlier one.
    ///
    /// # Errors
    /// When the system has no pseudo-terminal to give, or the link cannot be made.
    pub(crate) fn open(name: PathBuf) -> io::Result<Self> {
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
    pub(crate) fn descriptor(&self) -> BorrowedFd<'_> {
        self.robot.as_fd()
    }

    /// The bytes that wait from a client, none or some.
    ///
    /// # Errors
    /// When the terminal fails.
    pub(crate) fn read(&self) -> io::Result<Vec<u8>> {
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
    pub(crate) fn write(&self, mut bytes: &[u8]) -> io::Result<usize> {
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

    /// Whether clients have taken everything that was sent.
    ///
    /// # Errors
    /// When the terminal fails.
    pub(crate) fn is_drained(&self) -> io::Result<bool> {
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
