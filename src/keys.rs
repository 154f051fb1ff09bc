//! The keys that are pressed on a terminal.
//!
//! Not read with crossterm, which reads for ever from a terminal that has hung up (0.29).

use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::io::Errno;
use std::fs::File;
use std::io::{self, IsTerminal};
use std::os::fd::{AsFd, OwnedFd};
use std::time::Duration;

/// Ctrl-C in raw mode.
const CTRL_C: u8 = 0x03;
/// The escape key alone; with more bytes the begin of another key.
const ESCAPE: u8 = 0x1b;

/// A terminal in raw mode that is asked whether to quit.
#[derive(Debug)]
pub(crate) struct Keys(OwnedFd);

/// What a wait for a key has found.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Pressed {
    /// No key, or one without a meaning.
    Nothing,
    /// q, Esc or Ctrl-C.
    Quit,
    /// The terminal has hung up.
    Closed,
}

impl Keys {
    /// The terminal of standard input, or else that of the session.
    pub(crate) fn open() -> io::Result<Self> {
        let stdin = io::stdin();
        if stdin.is_terminal() { stdin.as_fd().try_clone_to_owned().map(Self) } else { File::open("/dev/tty").map(|it| Self(it.into())) }
    }

    /// Waits for a key; a signal ends the wait.
    pub(crate) fn wait(&self, at_most: Duration) -> io::Result<Pressed> {
        let timeout = Timespec { tv_sec: at_most.as_secs().cast_signed(), tv_nsec: at_most.subsec_nanos().into() };
        let mut polled = [PollFd::new(&self.0, PollFlags::IN)];
        match poll(&mut polled, Some(&timeout)) {
            Ok(0) | Err(Errno::INTR) => return Ok(Pressed::Nothing),
            Ok(_) => {}
            Err(error) => return Err(error.into()),
        }
        if polled[0].revents().intersects(PollFlags::HUP | PollFlags::ERR | PollFlags::NVAL) {
            return Ok(Pressed::Closed);
        }
        let mut bytes = [0; 64];
        match rustix::io::read(&self.0, &mut bytes) {
            Err(Errno::INTR | Errno::AGAIN) => Ok(Pressed::Nothing),
            Ok(0) | Err(Errno::IO) => Ok(Pressed::Closed),
            Ok(count) => Ok(if quits(&bytes[..count]) { Pressed::Quit } else { Pressed::Nothing }),
            Err(error) => Err(error.into()),
        }
    }
}

fn quits(bytes: &[u8]) -> bool {
    bytes == [ESCAPE] || bytes.first() != Some(&ESCAPE) && bytes.iter().any(|byte| [b'q', CTRL_C].contains(byte))
}

#[cfg(test)]
mod tests {
    use super::*;
    use rustix::fs::{Mode, OFlags};
    use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
    use rustix::termios::{OptionalActions, tcgetattr, tcsetattr};

    /// Longer than any test lasts: what waits for nothing fails by it.
    const LONG: Duration = Duration::from_secs(600);

    /// The side of the user and the side of the programs.
    fn terminal() -> (OwnedFd, Keys) {
        let user = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY | OpenptFlags::CLOEXEC).unwrap();
        grantpt(&user).unwrap();
        unlockpt(&user).unwrap();
        let name = ptsname(&user, Vec::new()).unwrap();
        let programs = rustix::fs::open(&*name, OFlags::RDWR | OFlags::NOCTTY | OFlags::CLOEXEC, Mode::empty()).unwrap();
        let mut line = tcgetattr(&programs).unwrap();
        line.make_raw();
        tcsetattr(&programs, OptionalActions::Now, &line).unwrap();
        (user, Keys(programs))
    }

    #[test]
    fn q_escape_and_ctrl_c_quit_and_other_keys_do_not() {
        let (user, keys) = terminal();
        for (bytes, expected) in [
            (&b"x"[..], Pressed::Nothing),
            (b"q", Pressed::Quit),
            (b"\x1b", Pressed::Quit),
            (b"\x1b[A", Pressed::Nothing),
            (b"\x03", Pressed::Quit),
            (b"\xff\xfe", Pressed::Nothing),
        ] {
            rustix::io::write(&user, bytes).unwrap();
            assert_eq!(keys.wait(LONG).unwrap(), expected, "{bytes:?}");
        }
        assert_eq!(keys.wait(Duration::ZERO).unwrap(), Pressed::Nothing);
    }

    #[test]
    fn a_terminal_that_hangs_up_is_closed() {
        let (user, keys) = terminal();
        drop(user);
        assert_eq!(keys.wait(LONG).unwrap(), Pressed::Closed);
        assert_eq!(keys.wait(LONG).unwrap(), Pressed::Closed, "it stays so");
    }
}
