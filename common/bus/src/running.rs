//! The deployments that run on this machine.

use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};

use rustix::fs::{FlockOperation, flock};
use rustix::io::Errno;

use crate::error::DomainError;
use crate::paths::{DomainPaths, names, runtime_dir};

/// A deployment that runs on this machine under this user.
///
/// ```
/// use stillmap_bus::{Domain, RunningDomain};
///
/// let name = format!("example-running-{}", std::process::id());
/// let domain = Domain::open(&name, 1.0)?;
/// assert!(RunningDomain::all()?.iter().any(|running| running.name() == name));
/// domain.close()?;
/// # Ok::<(), stillmap_bus::DomainError>(())
/// ```
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct RunningDomain {
    paths: DomainPaths,
    run: u64,
    pid: u32,
}

impl RunningDomain {
    /// Every deployment that runs, by name.
    ///
    /// # Errors
    /// When the runtime folder cannot be read.
    pub fn all() -> Result<Vec<Self>, DomainError> {
        Ok(Self::all_in(&Self::folder()?))
    }

    /// The folder in which the deployments of this user are looked for.
    ///
    /// # Errors
    /// When it cannot be made, or is another user's.
    pub fn folder() -> Result<PathBuf, DomainError> {
        runtime_dir().map_err(|source| DomainError::Io { path: "the runtime folder".into(), source })
    }

    /// Every deployment that runs in a runtime folder, by name.
    #[must_use]
    pub fn all_in(runtime: &Path) -> Vec<Self> {
        let mut running: Vec<Self> = names(runtime).into_iter().filter_map(|name| Self::look(&DomainPaths::new(runtime, &name))).collect();
        running.sort_by(|a, b| a.paths.name.cmp(&b.paths.name));
        running
    }

    /// Its name.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.paths.name
    }

    /// Process id of its supervisor.
    #[must_use]
    pub fn pid(&self) -> u32 {
        self.pid
    }

    /// Its folder.
    #[must_use]
    pub fn directory(&self) -> &Path {
        &self.paths.directory
    }

    pub(crate) fn run(&self) -> u64 {
        self.run
    }

    pub(crate) fn paths(&self) -> &DomainPaths {
        &self.paths
    }

    fn look(paths: &DomainPaths) -> Option<Self> {
        let mut file = File::open(&paths.lock).ok()?;
        // Any other error than that the lock is held is one of the file system.
        if flock(&file, FlockOperation::NonBlockingLockShared) != Err(Errno::WOULDBLOCK) {
            return None;
        }
        let mut text = String::new();
        file.read_to_string(&mut text).ok()?;
        let (pid, run) = text.split_once(' ')?;
        Some(Self { paths: paths.clone(), run: u64::from_str_radix(run, 16).ok()?, pid: pid.parse().ok()? })
    }
}
