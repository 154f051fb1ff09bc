//! The folder for outputs, locked by one deployment at a time.

use crate::running::RunError;
use rustix::fs::{FlockOperation, flock};
use rustix::io::Errno;
use std::fs::File;
use std::path::Path;

/// Keeps other deployments from writing into the folder while the file is open: logs and maps would be mixed up.
pub(crate) fn lock_output(out: &Path) -> Result<File, RunError> {
    let opened = std::fs::create_dir_all(out).and_then(|()| File::open(out));
    let folder = opened.map_err(|source| RunError::System { what: "the folder for outputs", source })?;
    match flock(&folder, FlockOperation::NonBlockingLockExclusive) {
        Err(Errno::WOULDBLOCK) => Err(RunError::OutputTaken { out: out.to_owned() }),
        // Some file systems lock no folders. The lock of the domain still keeps out a second deployment of this name.
        Ok(()) | Err(_) => Ok(folder),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_folder_is_locked_by_one_at_a_time() {
        let out = tempfile::tempdir().expect("a folder");
        let locked = lock_output(out.path()).expect("free");
        let error = lock_output(out.path()).expect_err("taken").to_string();
        assert!(error.contains(&out.path().display().to_string()) && error.contains("another deployment"), "{error}");
        drop(locked);
        drop(lock_output(out.path()).expect("free again"));
    }
}
