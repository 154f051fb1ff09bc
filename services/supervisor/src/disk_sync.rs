//! Brings to the disk what a power cut must not take: the checkpoints and the log, all at once.
//!
//! One call for the whole file system keeps the order of the writes: the pose of the robot is not older on the disk than the map. What is
//! replaced between two calls may be empty after a cut. It runs in a thread, since a slow disk takes longer than a supervisor may be silent.

use rustix::fs::syncfs;
use std::fs::File;
use std::io;
use std::path::{Path, PathBuf};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// The folder whose file system is synced from time to time.
#[derive(Debug)]
pub(crate) struct DiskSync {
    folder: PathBuf,
    every: Duration,
    due: Duration,
    running: Option<JoinHandle<io::Result<Duration>>>,
    is_slow: bool,
    has_failed: bool,
}

impl DiskSync {
    pub(crate) fn new(folder: &Path, every: Duration) -> Self {
        Self { folder: folder.to_owned(), every, due: every, running: None, is_slow: false, has_failed: false }
    }

    /// Starts the next one when it is due. What keeps the disk from being up to date is logged once.
    pub(crate) fn advance(&mut self, now: Duration) {
        match self.running.take_if(|running| running.is_finished()).map(JoinHandle::join) {
            None => {}
            Some(Ok(Ok(took))) => {
                self.has_failed = false;
                let is_slow = took > self.every;
                if is_slow && !self.is_slow {
                    let (took, every) = (took.as_secs_f64(), self.every.as_secs_f64());
                    tracing::warn!("the disk took {took:.0} s to store what it has: a power cut takes that much more than {every:.0} s");
                }
                self.is_slow = is_slow;
            }
            Some(Ok(Err(error))) if !std::mem::replace(&mut self.has_failed, true) => {
                tracing::error!("{}: cannot be brought to the disk: {error}; a power cut takes more", self.folder.display());
            }
            Some(_) => {}
        }
        if self.running.is_none() && now >= self.due {
            self.due = now + self.every;
            let folder = self.folder.clone();
            self.running = std::thread::Builder::new().name("disk".to_owned()).spawn(move || sync(&folder)).ok();
        }
    }
}

/// Syncs the file system of a folder; how long that took.
fn sync(folder: &Path) -> io::Result<Duration> {
    let since = Instant::now();
    syncfs(File::open(folder)?)?;
    Ok(since.elapsed())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Waits for the running one.
    fn finish(of: &mut DiskSync) {
        while of.running.as_ref().is_some_and(|running| !running.is_finished()) {
            std::thread::yield_now();
        }
    }

    #[test]
    fn one_runs_at_a_time_when_it_is_due() {
        let folder = tempfile::tempdir().unwrap();
        let s = Duration::from_secs;
        let mut it = DiskSync::new(folder.path(), s(10));
        it.advance(s(9));
        assert!(it.running.is_none());
        it.advance(s(10));
        assert!(it.running.is_some());
        finish(&mut it);
        it.advance(s(19));
        assert!(it.running.is_none() && !it.has_failed, "it has ended, and the next one is not due");
        it.advance(s(20));
        assert!(it.running.is_some());
        finish(&mut it);
    }

    #[test]
    fn a_folder_that_is_gone_is_an_error_until_it_is_back() {
        let parent = tempfile::tempdir().unwrap();
        let folder = parent.path().join("out");
        let s = Duration::from_secs;
        let mut it = DiskSync::new(&folder, s(10));
        for (at, fails) in [(10, true), (20, true), (30, false)] {
            if !fails {
                std::fs::create_dir(&folder).unwrap();
            }
            it.advance(s(at));
            finish(&mut it);
            it.advance(s(at + 1));
            assert_eq!(it.has_failed, fails, "at {at} s");
        }
    }
}
