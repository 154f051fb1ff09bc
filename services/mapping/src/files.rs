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
    let replaced = write(&fresh, contents).and_then(|()| std::fs::rename(&fresh, path));
    if replaced.is_err() {
        // Half a file is of no use, and takes room on a disk that may be full.
        let _ = std::fs::remove_file(&fresh);
    }
    replaced
}

fn write(path: &Path, contents: &[u8]) -> io::Result<()> {
    let mut file = std::fs::File::create(path)?;
    file.write_all(contents)?;
    file.sync_all()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_failed_write_leaves_only_the_file_that_was_there() {
        let folder = tempfile::tempdir().unwrap();
        let names = || {
            let mut names: Vec<_> = std::fs::read_dir(folder.path()).unwrap().map(|entry| entry.unwrap().file_name()).collect();
            names.sort();
            names
        };
        let file = |name| MapFile { name, contents: b"P5".to_vec() };
        write_files(folder.path(), &[file("map.pgm")]).unwrap();
        // A folder is not replaced by a file.
        std::fs::create_dir(folder.path().join("map.png")).unwrap();
        let error = write_files(folder.path(), &[file("map.png")]).unwrap_err();
        assert_eq!(error.path, folder.path().join("map.png"));
        assert_eq!(names(), ["map.pgm", "map.png"]);
    }
}
