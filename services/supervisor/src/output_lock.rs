//! The folder for outputs, locked by one command at a time.

use crate::running::RunError;
use rustix::fs::{FlockOperation, flock};
use rustix::io::Errno;
use std::fs::File;
use std::path::{Path, PathBuf};

/// A folder into which no other command writes while this value lives: logs and maps would be mixed up.
#[derive(Debug)]
pub struct OutputFolder {
    path: PathBuf,
    /// The lock is on the open file.
    _locked: File,
}

impl OutputFolder {
    /// Locks a folder. It is created if it is missing.
    ///
    /// # Errors
    /// When it cannot be created, or another command holds it.
    pub fn lock(path: &Path) -> Result<Self, RunError> {
        let opened = std::fs::create_dir_all(path).and_then(|()| File::open(path));
        let folder = opened.map_err(|source| RunError::System { what: "the folder for outputs", source })?;
        match flock(&folder, FlockOperation::NonBlockingLockExclusive) {
            Err(Errno::WOULDBLOCK) => Err(RunError::OutputTaken { out: path.to_owned() }),
            // Some file systems lock no folders. The lock of the domain still keeps out a second deployment of this name.
            Ok(()) | Err(_) => Ok(Self { path: path.to_owned(), _locked: folder }),
        }
    }

    /// The folder.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_folder_is_locked_by_one_at_a_time() {
        let out = tempfile::tempdir().expect("a folder");
        let locked = OutputFolder::lock(out.path()).expect("free");
        let error = OutputFolder::lock(out.path()).expect_err("taken").to_string();
        assert!(error.contains(&out.path().display().to_string()) && error.contains("another run"), "{error}");
        drop(locked);
        drop(OutputFolder::lock(out.path()).expect("free again"));
    }
}
