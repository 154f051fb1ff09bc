//! Files written whole or not at all.

use std::io::{self, Write};
use std::path::{Path, PathBuf};

use crate::export::MapFile;

/// A file that could not be written.
#[derive(Debug, thiserror::Error)]
#[error("cannot write {path}: {source}")]
pub struct WriteError {
    /// The file.
    pub path: PathBuf,
    /// What the system says.
    pub source: io::Error,
}

/// Writes files into a folder, which is made when it is missing; returns their paths. A reader sees either the file that was
/// there before or the whole new one.
///
/// # Errors
/// The first file that cannot be written; those before it are written.
pub fn write_files(folder: &Path, files: &[MapFile]) -> Result<Vec<PathBuf>, WriteError> {
    std::fs::create_dir_all(folder).map_err(|source| WriteError { path: folder.to_owned(), source })?;
    files
        .iter()
        .map(|file| {
            let path = folder.join(file.name);
            match replace(&path, &file.contents) {
                Ok(()) => Ok(path),
                Err(source) => Err(WriteError { path, source }),
            }
        })
        .collect()
}

fn replace(path: &Path, contents: &[u8]) -> io::Result<()> {
    // The process id keeps two writers of the same map apart.
    let fresh = path.with_extension(format!("{}.fresh", std::process::id()));
    let mut file = std::fs::File::create(&fresh)?;
    file.write_all(contents)?;
    file.sync_all()?;
    std::fs::rename(&fresh, path)
}
