//! The locks of a domain: one that its supervisor holds alone, and one that its processes share.

use std::fs::{File, OpenOptions};
use std::io::{self, Read};
use std::os::unix::fs::{MetadataExt, OpenOptionsExt};
use std::path::Path;
use std::time::{Duration, Instant};

use rustix::fs::{FlockOperation, flock};
use rustix::io::Errno;

use crate::error::DomainError;
use crate::paths::DomainPaths;
use crate::wait::wait_readable;

/// How long a lock may be held by someone who only looks, or by processes that are about to be gone.
const LOCK_PATIENCE: Duration = Duration::from_secs(5);

/// Keeps a supervisor from removing the domain as long as the file is held.
pub(crate) fn join_members(paths: &DomainPaths) -> Result<File, DomainError> {
    check_exists(paths)?;
    let file = open_lock_file(&paths.members).map_err(|source| DomainError::Io { path: paths.members.clone(), source })?;
    flock(&file, FlockOperation::LockShared).map_err(|error| lock_error(&paths.members, error))?;
    Ok(file)
}

/// The folder of the bus is the last that a supervisor makes: a command that joined before would make it with other rights.
fn check_exists(paths: &DomainPaths) -> Result<(), DomainError> {
    if paths.root().is_dir() { Ok(()) } else { Err(DomainError::NoDomain { name: paths.name.clone() }) }
}

/// An observer's visit to a domain. Where the domain ends in the meantime, what the observer made since is removed with it.
#[derive(Debug)]
pub(crate) struct Visit(DomainPaths);

impl Visit {
    pub(crate) fn to(paths: &DomainPaths) -> Result<Self, DomainError> {
        check_exists(paths)?;
        Ok(Self(paths.clone()))
    }
}

impl Drop for Visit {
    fn drop(&mut self) {
        let paths = &self.0;
        // While a supervisor runs, and after it was killed, its lock is there. A supervisor that ends removes it last.
        let is_left = paths.directory.exists() && !paths.lock.exists();
        if is_left
            && let Ok(lock) = open_lock_file(&paths.lock)
            && is_free(&lock)
            && is_current(&lock, &paths.lock)
        {
            let _ = paths.wipe();
            let _ = std::fs::remove_file(&paths.lock);
        }
    }
}

/// Takes a lock that no process holds.
pub(crate) fn is_free(file: &File) -> bool {
    flock(file, FlockOperation::NonBlockingLockExclusive).is_ok()
}

pub(crate) fn take_lock(paths: &DomainPaths) -> Result<File, DomainError> {
    let io = |source| DomainError::Io { path: paths.lock.clone(), source };
    let started = Instant::now();
    loop {
        let mut lock = open_lock_file(&paths.lock).map_err(io)?;
        let taken = is_taken(&lock, &paths.lock)?;
        if taken && is_current(&lock, &paths.lock) {
            return Ok(lock);
        }
        if started.elapsed() > LOCK_PATIENCE / 5 && !taken {
            let mut pid = String::new();
            lock.read_to_string(&mut pid).map_err(io)?;
            let pid = pid.split(' ').next().unwrap_or_default().to_owned();
            return Err(DomainError::Running { name: paths.name.clone(), pid });
        }
        pause();
    }
}

/// Tries to take a lock; fails where the file system has none.
fn is_taken(file: &File, path: &Path) -> Result<bool, DomainError> {
    match flock(file, FlockOperation::NonBlockingLockExclusive) {
        Ok(()) => Ok(true),
        Err(Errno::WOULDBLOCK | Errno::INTR) => Ok(false),
        Err(error) => Err(lock_error(path, error)),
    }
}

fn lock_error(path: &Path, error: Errno) -> DomainError {
    DomainError::NoLocks { path: path.to_owned(), source: error.into() }
}

pub(crate) fn wait_until_deserted(paths: &DomainPaths) -> Result<File, DomainError> {
    let io = |source| DomainError::Io { path: paths.members.clone(), source };
    let members = open_lock_file(&paths.members).map_err(io)?;
    let started = Instant::now();
    while !is_taken(&members, &paths.members)? {
        if started.elapsed() > LOCK_PATIENCE {
            return Err(DomainError::StillInhabited { name: paths.name.clone(), waited: LOCK_PATIENCE });
        }
        pause();
    }
    Ok(members)
}

/// The kernel has no way to wait for a file lock with a limit.
fn pause() {
    let _ = wait_readable([], Duration::from_millis(5));
}

pub(crate) fn open_lock_file(path: &Path) -> io::Result<File> {
    OpenOptions::new().read(true).write(true).create(true).truncate(false).mode(0o600).open(path)
}

/// Whether the file behind the path is still the one that was opened, and locked.
pub(crate) fn is_current(file: &File, path: &Path) -> bool {
    let identity = |found: io::Result<std::fs::Metadata>| found.ok().map(|found| (found.dev(), found.ino()));
    identity(file.metadata()) == identity(std::fs::metadata(path))
}
