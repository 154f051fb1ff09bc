//! What can be wrong with a bag.

use std::io;
use std::path::{Path, PathBuf};

use drivelog::LogError;

/// The reason that a bag is not imported, or that none is written.
#[derive(Debug, thiserror::Error)]
pub enum BagError {
    /// A file cannot be opened, read or written.
    #[error("{}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// Why not.
        source: io::Error,
    },
    /// The folder has no file of a bag.
    #[error("{}: has no file of a bag, expected .mcap, .db3, .mcap.zstd or .db3.zstd", path.display())]
    NoBag {
        /// The folder or the file.
        path: PathBuf,
    },
    /// A file that is no SQLite bag.
    #[error("{}: {source}", path.display())]
    Sqlite {
        /// The file.
        path: PathBuf,
        /// What SQLite says.
        source: rusqlite::Error,
    },
    /// An SQLite file without a table that a bag has.
    #[error("{}: has no table {table:?} with stored columns only", path.display())]
    NoTable {
        /// The file.
        path: PathBuf,
        /// The table.
        table: &'static str,
    },
    /// A packed file that unpacks to more than is read.
    #[error("{}: unpacks to more than {limit} bytes", path.display())]
    TooLarge {
        /// The file.
        path: PathBuf,
        /// The most that is read, bytes.
        limit: u64,
    },
    /// A file that breaks off.
    #[error("{}: is cut at byte {offset}", path.display())]
    Cut {
        /// The file.
        path: PathBuf,
        /// Size of what can be read, bytes.
        offset: u64,
    },
    /// An MCAP file that cannot be read, or a log that cannot be written.
    #[error(transparent)]
    Log(#[from] LogError),
    /// A topic that the caller names and the bag lacks.
    #[error("topic {topic}: is not in the bag, which has {present}")]
    NoTopic {
        /// The topic.
        topic: String,
        /// What the bag has.
        present: String,
    },
    /// A topic that cannot be imported.
    #[error("topic {topic}: {problem}")]
    Topic {
        /// The topic.
        topic: String,
        /// What is wrong with it.
        problem: String,
    },
    /// Several topics of which one is needed.
    #[error("the bag has several topics with {of}: {found}; choose one with --topics")]
    Ambiguous {
        /// What they carry.
        of: &'static str,
        /// The topics.
        found: String,
    },
    /// Something that every import needs.
    #[error("the bag has no {0}")]
    Missing(&'static str),
}

impl BagError {
    pub(crate) fn io(path: &Path) -> impl FnOnce(io::Error) -> Self {
        let path = path.to_owned();
        move |source| Self::Io { path, source }
    }

    pub(crate) fn sqlite(path: &Path) -> impl FnOnce(rusqlite::Error) -> Self {
        let path = path.to_owned();
        move |source| Self::Sqlite { path, source }
    }
}
