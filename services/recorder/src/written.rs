//! What a recorder has written, to be compared with what is there.

use std::fmt;
use std::fs;
use std::io;
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};

use drivelog::part_path;
use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

/// A part of the log as it was written.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub struct WrittenPart {
    /// Its number, from 1.
    pub number: u32,
    /// The device that has its file.
    pub device: u64,
    /// The inode of its file.
    pub inode: u64,
    /// Bytes written.
    pub bytes: u64,
}

/// What has happened to the file of a part.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Change {
    /// The file is not there, or another file has its name.
    Removed,
    /// The file has another name.
    Moved,
    /// The end of the file is gone.
    Truncated {
        /// Size of the rest.
        bytes: u64,
    },
}

impl WrittenPart {
    /// The file of this part of the log that begins at `first`.
    #[must_use]
    pub fn path(&self, first: &Path) -> PathBuf {
        if self.number > 1 { part_path(first, self.number) } else { first.to_owned() }
    }

    /// What has happened to the file since it was written; `None` if it is as it should be, or cannot be looked at.
    #[must_use]
    pub fn change(&self, path: &Path) -> Option<Change> {
        match fs::symlink_metadata(path) {
            Ok(status) if (status.dev(), status.ino()) != (self.device, self.inode) => Some(Change::Removed),
            Ok(status) if status.len() < self.bytes => Some(Change::Truncated { bytes: status.len() }),
            Err(error) if is_gone(&error) => Some(Change::Removed),
            Ok(_) | Err(_) => None,
        }
    }
}

/// Whether an error says that a file or its folder does not exist any more.
fn is_gone(error: &io::Error) -> bool {
    matches!(error.kind(), io::ErrorKind::NotFound | io::ErrorKind::NotADirectory | io::ErrorKind::StaleNetworkFileHandle)
}

impl fmt::Display for Change {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Removed => f.write_str("was removed"),
            Self::Moved => f.write_str("was moved"),
            Self::Truncated { bytes } => write!(f, "was truncated to {bytes} bytes"),
        }
    }
}
