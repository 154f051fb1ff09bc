//! The state of a process in a file: written whole or not at all, checked when read.

use std::io::{self, Write};
use std::path::{Path, PathBuf};

use crate::paths::{ignore_missing, make_private};

const MAGIC: &[u8; 8] = b"SMCHKPT1";
const HEAD: usize = MAGIC.len() + 8 + 8 + 4;

/// Where a process keeps its state between its incarnations.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Checkpoint {
    path: PathBuf,
    run: u64,
}

/// State that could not be kept or taken up.
#[derive(Debug, thiserror::Error)]
pub enum CheckpointError {
    /// The file system refuses.
    #[error("{path}: {source}")]
    Io {
        /// The file.
        path: PathBuf,
        /// What it says.
        source: io::Error,
    },
    /// The file is not a checkpoint of this run, or is damaged. It has been set aside.
    #[error("{path} is no checkpoint of this run ({reason}); set aside as {aside}")]
    Damaged {
        /// The file.
        path: PathBuf,
        /// Where it is now.
        aside: PathBuf,
        /// What is wrong with it.
        reason: String,
    },
}

impl Checkpoint {
    pub(crate) fn new(domain_directory: &Path, process: &str, run: u64) -> Self {
        Self { path: domain_directory.join("state").join(format!("{process}.checkpoint")), run }
    }

    /// The state as it was last saved, if it ever was.
    ///
    /// # Errors
    /// When the file cannot be read, or is damaged: then it is set aside and the next load finds none.
    pub fn load(&self) -> Result<Option<Vec<u8>>, CheckpointError> {
        let bytes = match std::fs::read(&self.path) {
            Ok(bytes) => bytes,
            Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(None),
            Err(source) => return Err(self.io(source)),
        };
        match self.parse(&bytes) {
            Ok(state) => Ok(Some(state.to_vec())),
            Err(reason) => {
                let aside = self.path.with_extension("damaged");
                std::fs::rename(&self.path, &aside).map_err(|source| self.io(source))?;
                Err(CheckpointError::Damaged { path: self.path.clone(), aside, reason })
            }
        }
    }

    /// Replaces what was saved before. After a kill at any moment, either the old or the new state is there.
    ///
    /// # Errors
    /// When the file system refuses; what was saved before stays.
    pub fn save(&self, state: &[u8]) -> Result<(), CheckpointError> {
        self.write(state).map_err(|source| self.io(source))
    }

    /// Forgets what was saved.
    ///
    /// # Errors
    /// When the file system refuses.
    pub fn remove(&self) -> Result<(), CheckpointError> {
        ignore_missing(std::fs::remove_file(&self.path)).map_err(|source| self.io(source))
    }

    fn write(&self, state: &[u8]) -> io::Result<()> {
        if let Some(folder) = self.path.parent() {
            make_private(folder)?;
        }
        let fresh = self.path.with_extension("fresh");
        let mut file = std::fs::File::create(&fresh)?;
        file.write_all(MAGIC)?;
        file.write_all(&self.run.to_le_bytes())?;
        file.write_all(&(state.len() as u64).to_le_bytes())?;
        file.write_all(&crc32fast::hash(state).to_le_bytes())?;
        file.write_all(state)?;
        std::fs::rename(&fresh, &self.path)
    }

    fn parse<'a>(&self, bytes: &'a [u8]) -> Result<&'a [u8], String> {
        let (head, state) = bytes.split_at_checked(HEAD).ok_or_else(|| format!("{} bytes, expected at least {HEAD}", bytes.len()))?;
        let number = |at: usize| head[at..at + 8].try_into().map_or(0, u64::from_le_bytes);
        if !head.starts_with(MAGIC) {
            return Err("it begins otherwise".to_owned());
        }
        let run = number(8);
        if run != self.run {
            return Err(format!("run {run:016x}, expected {:016x}", self.run));
        }
        if number(16) != state.len() as u64 {
            return Err(format!("{} bytes of state, expected {}", state.len(), number(16)));
        }
        let crc = head[24..28].try_into().map_or(0, u32::from_le_bytes);
        let found = crc32fast::hash(state);
        if crc != found {
            return Err(format!("checksum {found:08x}, expected {crc:08x}"));
        }
        Ok(state)
    }

    fn io(&self, source: io::Error) -> CheckpointError {
        CheckpointError::Io { path: self.path.clone(), source }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_saved_is_loaded_and_damage_is_refused_once() {
        let folder = tempfile::tempdir().expect("a folder");
        let checkpoint = Checkpoint::new(folder.path(), "mapping", 7);
        assert_eq!(checkpoint.load().expect("nothing there"), None);
        checkpoint.save(b"first").expect("saved");
        checkpoint.save(b"second").expect("saved");
        assert_eq!(checkpoint.load().expect("readable").as_deref(), Some(&b"second"[..]));

        let whole = std::fs::read(&checkpoint.path).expect("readable");
        for at in 0..whole.len() {
            for damaged in [whole[..at].to_vec(), {
                let mut b = whole.clone();
                b[at] ^= 1;
                b
            }] {
                std::fs::write(&checkpoint.path, &damaged).expect("written");
                let error = checkpoint.load().expect_err("damaged");
                assert!(matches!(error, CheckpointError::Damaged { .. }), "byte {at}: {error}");
                assert_eq!(checkpoint.load().expect("set aside"), None);
            }
        }
    }

    #[test]
    fn another_run_is_refused() {
        let folder = tempfile::tempdir().expect("a folder");
        Checkpoint::new(folder.path(), "mapping", 7).save(b"state").expect("saved");
        assert!(Checkpoint::new(folder.path(), "mapping", 8).load().is_err());
    }
}
