//! The folder for outputs, held by one deployment at a time.

use crate::running::RunError;
use rustix::fs::{FlockOperation, flock};
use rustix::io::Errno;
use std::fs::File;
use std::path::Path;

/// Keeps other deployments from writing into the folder as long as the file is held: logs and maps would be mixed up.
pub(crate) fn hold(out: &Path) -> Result<File, RunError> {
    let opened = std::fs::create_dir_all(out).and_then(|()| File::open(out));
    let folder = opened.map_err(|source| RunError::System { what: "the folder for outputs", source })?;
    match flock(&folder, FlockOperation::NonBlockingLockExclusive) {
        Err(Errno::WOULDBLOCK) => Err(RunError::OutputTaken { out: out.to_owned() }),
        // Some file systems lock no folders: better without than not at all.
        Ok(()) | Err(_) => Ok(folder),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_folder_is_held_by_one_at_a_time() {
        let out = tempfile::tempdir().expect("a folder");
        let held = hold(out.path()).expect("free");
        let error = hold(out.path()).expect_err("taken").to_string();
        assert!(error.contains(&out.path().display().to_string()) && error.contains("another deployment"), "{error}");
        drop(held);
        drop(hold(out.path()).expect("free again"));
    }
}
