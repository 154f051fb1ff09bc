//! Shared memory that is used up: what is free of it is taken, and given back at the end.

use std::fs::File;
use std::io;
use std::path::Path;

use rustix::fs::{FallocateFlags, Mode, OFlags, fallocate, open, statvfs};

/// Where shared memory is, on Linux.
const SHARED_MEMORY: &str = "/dev/shm";
/// Most memory that is taken. A file system of this kind may be as large as the computer's memory, which everybody needs.
const MOST_BYTES: u64 = 1 << 30;

/// Memory that could not be taken.
#[derive(Debug, thiserror::Error)]
pub enum BallastError {
    /// Taking it would take the computer's memory.
    #[error(
        "{folder} has {free} bytes free, expected at most {MOST_BYTES}: a deployment to rehearse this with needs a smaller one (mount -o remount,size=256m {folder})"
    )]
    TooMuch {
        /// The file system.
        folder: String,
        /// What is free of it.
        free: u64,
    },
    /// The file system refuses.
    #[error("{folder}: {source}")]
    Io {
        /// The file system.
        folder: String,
        /// What it says.
        source: io::Error,
    },
}

/// A file without a name that takes all room of a file system; whoever holds it gives that back when it is dropped, or killed.
#[derive(Debug)]
pub struct Ballast {
    folder: String,
    file: Option<File>,
    bytes: u64,
}

impl Default for Ballast {
    fn default() -> Self {
        Self::in_folder(Path::new(SHARED_MEMORY))
    }
}

impl Ballast {
    fn in_folder(folder: &Path) -> Self {
        Self { folder: folder.display().to_string(), file: None, bytes: 0 }
    }

    /// Takes what is free now.
    ///
    /// # Errors
    /// When that is too much, or the file system refuses.
    pub fn fill(&mut self) -> Result<(), BallastError> {
        let folder = &self.folder;
        let refused = |error: rustix::io::Errno| BallastError::Io { folder: folder.clone(), source: error.into() };
        let found = statvfs(folder.as_str()).map_err(refused)?;
        let mut free = found.f_bavail.saturating_mul(found.f_frsize);
        if free.saturating_add(self.bytes) > MOST_BYTES {
            return Err(BallastError::TooMuch { folder: folder.clone(), free });
        }
        let file = match &mut self.file {
            Some(file) => file,
            none => none.insert(open(folder.as_str(), OFlags::TMPFILE | OFlags::RDWR, Mode::RUSR | Mode::WUSR).map_err(refused)?.into()),
        };
        // Others take some at the same time, and all that was asked for is given or nothing.
        while free > 0 {
            match fallocate(&*file, FallocateFlags::empty(), self.bytes, free) {
                Ok(()) => {
                    self.bytes += free;
                    break;
                }
                Err(rustix::io::Errno::NOSPC) => free /= 2,
                Err(error) => return Err(refused(error)),
            }
        }
        Ok(())
    }

    /// Gives it back.
    pub fn free(&mut self) {
        (self.file, self.bytes) = (None, 0);
    }

    /// Bytes that are held.
    #[must_use]
    pub fn bytes(&self) -> u64 {
        self.bytes
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_system_that_is_too_large_is_left_alone() {
        let found = statvfs("/").unwrap();
        let mut ballast = Ballast::in_folder(Path::new("/"));
        if found.f_bavail.saturating_mul(found.f_frsize) > MOST_BYTES {
            assert!(matches!(ballast.fill(), Err(BallastError::TooMuch { free, .. }) if free > MOST_BYTES));
        }
        assert_eq!(ballast.bytes(), 0);
        let missing = Ballast::in_folder(Path::new("/nowhere/at/all")).fill();
        assert!(matches!(missing, Err(BallastError::Io { .. })));
    }
}
