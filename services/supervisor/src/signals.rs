//! The signals that ask for the end of a run.

use std::io;
use std::os::unix::net::UnixStream;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};

const SIGNALS: [i32; 3] = [SIGINT, SIGTERM, SIGHUP];

/// Each of the signals as a byte to read.
pub(crate) fn stop_requests() -> io::Result<UnixStream> {
    let (requests, end) = UnixStream::pair()?;
    requests.set_nonblocking(true)?;
    for signal in SIGNALS {
        signal_hook::low_level::pipe::register(signal, end.try_clone()?)?;
    }
    Ok(requests)
}

/// Whether an end was asked for (SIGINT, SIGTERM, SIGHUP): for commands that run several deployments. One that comes when a run ends by
/// itself, or between two, ends neither.
#[derive(Debug, Clone)]
pub struct StopAsked(Arc<AtomicBool>);

impl StopAsked {
    /// Watches from now on, as long as the program runs.
    ///
    /// # Errors
    /// When the system refuses it.
    pub fn watch() -> io::Result<Self> {
        let asked = Arc::new(AtomicBool::new(false));
        for signal in SIGNALS {
            signal_hook::flag::register(signal, Arc::clone(&asked))?;
        }
        Ok(Self(asked))
    }

    /// Whether one of the signals has come.
    #[must_use]
    pub fn has_come(&self) -> bool {
        self.0.load(Ordering::SeqCst)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_signal_asks_for_an_end() {
        for signal in SIGNALS {
            let asked = StopAsked::watch().unwrap();
            assert!(!asked.has_come());
            signal_hook::low_level::raise(signal).unwrap();
            assert!(asked.has_come(), "{signal}");
        }
    }
}
