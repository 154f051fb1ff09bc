//! The fault `memory`: all free shared memory is taken, and released at the end.

use std::fs::File;
use std::io;
use std::path::Path;

use rustix::fs::{FallocateFlags, Mode, OFlags, fallocate, open, statvfs};

/// Where Linux mounts shared memory.
const SHARED_MEMORY: &str = "/dev/shm";
/// Most memory that is taken. This file system may be as large as half the memory of the computer, which every program needs.
const MOST_BYTES: u64 = 1 << 30;

/// Shared memory could not be taken.
#[derive(Debug, thiserror::Error)]
pub enum MemoryFillError {
    /// More is free than may be taken.
    #[error(
        "{folder} has {free} bytes free, expected at most {MOST_BYTES}: make it smaller for this test (mount -o remount,size=256m {folder})"
    )]
    TooMuch {
        /// The file system.
        folder: String,
        /// Free bytes.
        free: u64,
    },
    /// The file system reports an error.
    #[error("{folder}: {source}")]
    Io {
        /// The file system.
        folder: String,
        /// Its error.
        source: io::Error,
    },
}

/// An unnamed file that takes all free space of a file system. The space is released when this is dropped or its process ends.
#[derive(Debug)]
pub struct MemoryFill {
    folder: String,
    most_bytes: u64,
    file: Option<File>,
    bytes: u64,
}

impl Default for MemoryFill {
    fn default() -> Self {
        Self::in_folder(Path::new(SHARED_MEMORY), MOST_BYTES)
    }
}

impl MemoryFill {
    fn in_folder(folder: &Path, most_bytes: u64) -> Self {
        Self { folder: folder.display().to_string(), most_bytes, file: None, bytes: 0 }
    }

    /// Takes what is free now.
    ///
    /// # Errors
    /// When more is free than may be taken, or the file system reports an error.
    pub fn fill(&mut self) -> Result<(), MemoryFillError> {
        let folder = &self.folder;
        let failed = |error: rustix::io::Errno| MemoryFillError::Io { folder: folder.clone(), source: error.into() };
        let found = statvfs(folder.as_str()).map_err(failed)?;
        let mut free = found.f_bavail.saturating_mul(found.f_frsize);
        if free.saturating_add(self.bytes) > self.most_bytes {
            return Err(MemoryFillError::TooMuch { folder: folder.clone(), free });
        }
        let file = match &mut self.file {
            Some(file) => file,
            none => none.insert(open(folder.as_str(), OFlags::TMPFILE | OFlags::RDWR, Mode::RUSR | Mode::WUSR).map_err(failed)?.into()),
        };
        // Other processes allocate at the same time, and fallocate gives all that is asked for or nothing.
        while free > 0 {
            match fallocate(&*file, FallocateFlags::empty(), self.bytes, free) {
                Ok(()) => {
                    self.bytes += free;
                    break;
                }
                Err(rustix::io::Errno::NOSPC) => free /= 2,
                Err(error) => return Err(failed(error)),
            }
        }
        Ok(())
    }

    /// Releases what is held.
    pub fn release(&mut self) {
        (self.file, self.bytes) = (None, 0);
    }

    /// Number of bytes held.
    #[must_use]
    pub fn bytes(&self) -> u64 {
        self.bytes
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_large_file_system_is_not_filled() {
        let mut fill = MemoryFill::in_folder(&std::env::temp_dir(), 0);
        assert!(matches!(fill.fill(), Err(MemoryFillError::TooMuch { free: 1.., .. })));
        assert_eq!(fill.bytes(), 0);
        let missing = MemoryFill::in_folder(Path::new("/nowhere/at/all"), MOST_BYTES).fill();
        assert!(matches!(missing, Err(MemoryFillError::Io { .. })));
    }
}
