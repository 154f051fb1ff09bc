//! SIGINT and SIGTERM as something to poll.

use std::io::{self, Read};
use std::os::fd::{AsFd, BorrowedFd};
use std::os::unix::net::UnixStream;

use signal_hook::consts::{SIGINT, SIGTERM, SIGXFSZ};

/// A request to stop, readable through its file descriptor.
#[derive(Debug)]
pub struct Signals {
    requests: UnixStream,
    last: Option<i32>,
    interrupt: std::sync::Arc<std::sync::atomic::AtomicBool>,
}

impl Signals {
    /// Takes over SIGINT and SIGTERM of this process.
    ///
    /// # Errors
    /// When the handlers cannot be installed.
    pub fn install() -> io::Result<Self> {
        let (requests, write) = UnixStream::pair()?;
        requests.set_nonblocking(true)?;
        let interrupt = std::sync::Arc::new(std::sync::atomic::AtomicBool::new(false));
        signal_hook::flag::register(SIGINT, interrupt.clone())?;
        signal_hook::low_level::pipe::register(SIGINT, write.try_clone()?)?;
        signal_hook::low_level::pipe::register(SIGTERM, write)?;
        // A file that may grow no further is an error of the write then, not the end of the process.
        signal_hook::flag::register(SIGXFSZ, std::sync::Arc::default())?;
        Ok(Self { requests, last: None, interrupt })
    }

    /// The signal that asked this process to stop, if one came.
    pub fn requested(&mut self) -> Option<i32> {
        let mut byte = [0];
        while matches!(self.requests.read(&mut byte), Ok(1)) {
            let interrupted = self.interrupt.load(std::sync::atomic::Ordering::Relaxed);
            self.last.get_or_insert(if interrupted { SIGINT } else { SIGTERM });
        }
        self.last
    }
}

impl AsFd for Signals {
    fn as_fd(&self) -> BorrowedFd<'_> {
        self.requests.as_fd()
    }
}
