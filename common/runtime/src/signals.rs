//! SIGINT and SIGTERM as something to poll.

use std::io::{self, Read};
use std::os::fd::{AsFd, BorrowedFd};
use std::os::unix::net::UnixStream;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM, SIGXFSZ};

/// A request to stop, readable through its file descriptor.
#[derive(Debug)]
pub struct Signals {
    requests: UnixStream,
    last: Option<i32>,
    count: u32,
    interrupt: Arc<AtomicBool>,
}

impl Signals {
    /// Takes over SIGINT and SIGTERM of this process, as far as they come from the process `supervisor`.
    ///
    /// From anybody else they end it at once, as if it had no handler: who is told so by the supervisor ends its streams, and others
    /// then finish, too, while the run is to continue. A child that ends by a signal is started again, and resumes from its checkpoint.
    ///
    /// # Errors
    /// When the handlers cannot be installed.
    pub fn install(supervisor: u32) -> io::Result<Self> {
        let (requests, write) = UnixStream::pair()?;
        requests.set_nonblocking(true)?;
        let interrupt = Arc::new(AtomicBool::new(false));
        let asked = Arc::new(AtomicBool::new(false));
        for signal in [SIGINT, SIGTERM] {
            end_unless_asked(supervisor, &asked, signal)?;
        }
        signal_hook::flag::register(SIGINT, interrupt.clone())?;
        signal_hook::low_level::pipe::register(SIGINT, write.try_clone()?)?;
        signal_hook::low_level::pipe::register(SIGTERM, write)?;
        // A file that may grow no further is an error of the write then, not the end of the process.
        signal_hook::flag::register(SIGXFSZ, Arc::default())?;
        Ok(Self { requests, last: None, count: 0, interrupt })
    }

    /// The signal by which the supervisor asked this process to stop, if one came.
    pub fn requested(&mut self) -> Option<i32> {
        let mut byte = [0];
        while matches!(self.requests.read(&mut byte), Ok(1)) {
            self.count += 1;
            let interrupted = self.interrupt.load(Ordering::Relaxed);
            self.last.get_or_insert(if interrupted { SIGINT } else { SIGTERM });
        }
        self.last
    }

    /// How often the supervisor has asked so far.
    pub fn count(&mut self) -> u32 {
        self.requested();
        self.count
    }
}

/// A flag that SIGHUP and SIGTERM set, which then do not end this process: for a command that leaves a terminal as it was.
///
/// # Errors
/// When the handlers cannot be installed.
pub fn flag_of_ends() -> io::Result<Arc<AtomicBool>> {
    let flag = Arc::new(AtomicBool::new(false));
    for signal in [SIGHUP, SIGTERM] {
        signal_hook::flag::register(signal, flag.clone())?;
    }
    Ok(flag)
}

impl AsFd for Signals {
    fn as_fd(&self) -> BorrowedFd<'_> {
        self.requests.as_fd()
    }
}

/// Gives a signal its default action when another process than `supervisor` has sent it before that one had; else the handlers after
/// this one follow. A process that the supervisor has asked may be asked once more by a script around it, and still ends in order.
#[expect(unsafe_code, reason = "who has sent a signal is known in its handler only")]
fn end_unless_asked(supervisor: u32, asked: &Arc<AtomicBool>, signal: i32) -> io::Result<()> {
    let asked = asked.clone();
    // SAFETY: the handler compares numbers, sets a flag and makes system calls that are async-signal-safe; it allocates nothing, takes
    // no lock and does not panic. Both signals come from kill(2) and its kin, which tell the sender, or from a terminal, which tells 0.
    let registered = unsafe {
        signal_hook_registry::register_sigaction(signal, move |info| {
            if u32::try_from(info.si_pid()) == Ok(supervisor) {
                asked.store(true, Ordering::Relaxed);
            } else if !asked.load(Ordering::Relaxed) {
                // Returns for no signal that ends a process.
                let _ = signal_hook::low_level::emulate_default_handler(signal);
            }
        })
    };
    registered.map(drop)
}
