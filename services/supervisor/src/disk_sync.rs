//! Brings to the disk what a power cut must not take: a set of checkpoints and the log, all at once.
//!
//! It runs in a thread, since a slow disk takes longer than a supervisor may be silent.

use runtime::CheckpointSets;
use rustix::fs::syncfs;
use std::fs::File;
use std::io;
use std::path::{Path, PathBuf};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// Time between two looks at whether the last one has ended.
const LOOK: Duration = Duration::from_millis(100);

/// The folder whose file system is synced from time to time, with the checkpoints in it.
#[derive(Debug)]
pub(crate) struct DiskSync {
    folder: PathBuf,
    sets: CheckpointSets,
    every: Duration,
    due: Duration,
    running: Option<JoinHandle<io::Result<Synced>>>,
    is_slow: bool,
    has_failed: bool,
}

/// A sync that succeeded.
#[derive(Debug)]
struct Synced {
    took: Duration,
    /// Writes the next set.
    next: CheckpointSets,
}

impl DiskSync {
    pub(crate) fn new(folder: &Path, sets: CheckpointSets, every: Duration) -> Self {
        Self { folder: folder.to_owned(), sets, every, due: every, running: None, is_slow: false, has_failed: false }
    }

    /// Starts the next one when it is due. What keeps the disk from being up to date is logged once.
    pub(crate) fn advance(&mut self, now: Duration) {
        self.take_ended();
        if self.running.is_none() && now >= self.due {
            self.due = now + self.every;
            self.start();
        }
    }

    /// Brings everything to the disk as it is at the end of a run, and calls `wait` while that takes. False where it fails.
    pub(crate) fn finish(&mut self, mut wait: impl FnMut()) -> bool {
        for is_last in [false, true] {
            if is_last {
                self.start();
            }
            while self.running.is_some() {
                wait();
                std::thread::park_timeout(LOOK);
                self.take_ended();
            }
        }
        !self.has_failed
    }

    fn start(&mut self) {
        let (folder, sets) = (self.folder.clone(), self.sets.clone());
        match std::thread::Builder::new().name("disk".to_owned()).spawn(move || sync(&folder, &sets)) {
            Ok(running) => self.running = Some(running),
            Err(error) => self.fail(&error),
        }
    }

    fn take_ended(&mut self) {
        match self.running.take_if(|running| running.is_finished()).map(JoinHandle::join) {
            None => {}
            Some(Ok(Ok(Synced { took, next }))) => {
                self.sets = next;
                self.has_failed = false;
                let is_slow = took > self.every;
                if is_slow && !self.is_slow {
                    let (took, every) = (took.as_secs_f64(), self.every.as_secs_f64());
                    tracing::warn!("the disk took {took:.0} s to store what it has: a power cut takes that much more than {every:.0} s");
                }
                self.is_slow = is_slow;
            }
            Some(Ok(Err(error))) => self.fail(&error),
            Some(Err(_)) => self.fail(&io::Error::other("the thread has failed")),
        }
    }

    fn fail(&mut self, error: &io::Error) {
        if !std::mem::replace(&mut self.has_failed, true) {
            tracing::error!("{}: cannot be brought to the disk: {error}; a power cut takes more", self.folder.display());
        }
    }
}

/// Adds a set of checkpoints and syncs the file system of a folder, for the log also where there is no set.
fn sync(folder: &Path, sets: &CheckpointSets) -> io::Result<Synced> {
    let since = Instant::now();
    let next = sets.write();
    syncfs(File::open(folder)?)?;
    Ok(Synced { next: next?, took: since.elapsed() })
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

    /// A folder with a note of a run, and its sets.
    fn sets(folder: &Path) -> CheckpointSets {
        let note = "stillmap run 2\nrobot\n00000001\n0000000000000007\n0\n00000000000000000000 c4854223\n\n";
        std::fs::write(folder.join("run"), note).unwrap();
        CheckpointSets::open(folder, &folder.join("fallback"), Vec::new()).unwrap()
    }

    #[test]
    fn one_runs_at_a_time_when_it_is_due() {
        let folder = tempfile::tempdir().unwrap();
        let s = Duration::from_secs;
        let mut it = DiskSync::new(folder.path(), sets(folder.path()), s(10));
        it.advance(s(9));
        assert!(it.running.is_none());
        it.advance(s(10));
        assert!(it.running.is_some());
        finish(&mut it);
        let first = it.sets.clone();
        it.advance(s(19));
        assert_ne!(it.sets, first, "the next set is another one");
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
        std::fs::create_dir(&folder).unwrap();
        let mut it = DiskSync::new(&folder, sets(&folder), s(10));
        std::fs::remove_dir_all(&folder).unwrap();
        let first = it.sets.clone();
        for (at, fails) in [(10, true), (20, true), (30, false)] {
            if !fails {
                std::fs::create_dir(&folder).unwrap();
                sets(&folder);
            }
            it.advance(s(at));
            finish(&mut it);
            it.advance(s(at + 1));
            assert_eq!((it.has_failed, it.sets == first), (fails, fails), "at {at} s");
        }
    }

    #[test]
    fn at_the_end_the_state_of_the_end_is_synced() {
        let folder = tempfile::tempdir().unwrap();
        let s = Duration::from_secs;
        let mut it = DiskSync::new(folder.path(), sets(folder.path()), s(10));
        it.advance(s(10));
        assert!(it.finish(|| ()));
        assert!(folder.path().join("set-1/list").exists(), "the one that was running may have begun before the last checkpoint");
        std::fs::remove_file(folder.path().join("run")).unwrap();
        assert!(!it.finish(|| ()));
    }
}
