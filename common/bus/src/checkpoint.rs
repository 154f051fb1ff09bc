//! The state of a process in a file: written whole or not at all, checked when read.

use core::cell::Cell;
use core::fmt::Display;
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use crate::paths::{free_name, make_private};

const MAGIC: &[u8; 8] = b"SMCHKPT2";
const HEAD: usize = MAGIC.len() + 8 + 8 + 4 + 4;

/// Where a process keeps its state between its incarnations.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Checkpoint {
    path: PathBuf,
    run: u64,
    start: u32,
    /// The file system refuses, and that has been said.
    refused: Cell<bool>,
}

/// What an earlier incarnation has kept.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Saved {
    /// Its state.
    pub state: Vec<u8>,
    /// The whole deployment has been stopped, or was killed, and started again since: what had ended then goes on.
    pub before_a_stop: bool,
}

/// State that could not be kept; what was kept before stays.
#[derive(Debug, thiserror::Error)]
#[error("{path}: {source}")]
pub struct CheckpointError {
    /// The file.
    pub path: PathBuf,
    /// What the file system says.
    pub source: io::Error,
}

impl Checkpoint {
    /// The checkpoint of a process in a folder of checkpoints, in a run that has been started `start` times before.
    pub(crate) fn new(folder: &Path, process: &str, run: u64, start: u32) -> Self {
        Self { path: folder.join(format!("{process}.checkpoint")), run, start, refused: Cell::new(false) }
    }

    /// What `restore` makes of what an earlier incarnation kept. `None` where there is nothing, or nothing that can be used: that
    /// is said, and put under another name, where nobody writes over it.
    pub fn take_up<T, E: Display>(&self, restore: impl FnOnce(&Saved) -> Result<T, E>) -> Option<T> {
        let problem = match std::fs::read(&self.path) {
            Err(error) if error.kind() == io::ErrorKind::NotFound => return None,
            Err(error) => error.to_string(),
            Ok(bytes) => match check(&bytes, self.run) {
                Err(damage) => damage,
                Ok((start, state)) => match restore(&Saved { state: state.to_vec(), before_a_stop: start < self.start }) {
                    Ok(restored) => return Some(restored),
                    Err(error) => error.to_string(),
                },
            },
        };
        let aside = free_name(&self.path);
        let path = self.path.display();
        match std::fs::rename(&self.path, &aside) {
            Ok(()) => tracing::error!("begins anew: {path} cannot be used ({problem}); it is kept as {}", aside.display()),
            Err(error) => tracing::error!("begins anew: {path} cannot be used ({problem}), and not be put aside: {error}"),
        }
        None
    }

    /// Replaces what was saved before. After a kill at any moment, either the old or the new state is there.
    ///
    /// # Errors
    /// When the file system refuses; what was saved before stays.
    pub fn save(&self, state: &[u8]) -> Result<(), CheckpointError> {
        self.write(state).map_err(|source| CheckpointError { path: self.path.clone(), source })
    }

    /// As [`save`](Self::save), for whoever goes on without: that the file system refuses is said once, and once that it no longer
    /// does.
    pub fn keep(&self, state: &[u8]) {
        match self.save(state) {
            Ok(()) if self.refused.replace(false) => tracing::info!("{} is kept again", self.path.display()),
            Ok(()) => {}
            Err(error) if !self.refused.replace(true) => tracing::error!("{error}; whoever is killed now goes on from an older state"),
            Err(_) => {}
        }
    }

    fn write(&self, state: &[u8]) -> io::Result<()> {
        if let Some(folder) = self.path.parent() {
            make_private(folder)?;
        }
        let fresh = self.path.with_extension("fresh");
        let written = self.write_to(&fresh, state).and_then(|()| std::fs::rename(&fresh, &self.path));
        if written.is_err() {
            // On a full disk half a state takes the room of what is worth more.
            let _ = std::fs::remove_file(&fresh);
        }
        written
    }

    fn write_to(&self, fresh: &Path, state: &[u8]) -> io::Result<()> {
        let mut file = std::fs::File::create(fresh)?;
        file.write_all(MAGIC)?;
        file.write_all(&self.run.to_le_bytes())?;
        file.write_all(&(state.len() as u64).to_le_bytes())?;
        file.write_all(&self.start.to_le_bytes())?;
        file.write_all(&checksum(self.start, state).to_le_bytes())?;
        file.write_all(state)
    }
}

fn checksum(start: u32, state: &[u8]) -> u32 {
    let mut hasher = crc32fast::Hasher::new();
    hasher.update(&start.to_le_bytes());
    hasher.update(state);
    hasher.finalize()
}

/// The number of the start in which a checkpoint was saved, and the state in it; or what is wrong with it as one of this run.
pub(crate) fn check(bytes: &[u8], run: u64) -> Result<(u32, &[u8]), String> {
    let (head, state) = bytes.split_at_checked(HEAD).ok_or_else(|| format!("{} bytes, expected at least {HEAD}", bytes.len()))?;
    let long = |at: usize| head[at..at + 8].try_into().map_or(0, u64::from_le_bytes);
    let short = |at: usize| head[at..at + 4].try_into().map_or(0, u32::from_le_bytes);
    if !head.starts_with(MAGIC) {
        return Err(format!("it begins with {:?}, expected {:?}", head[..8].escape_ascii().to_string(), MAGIC.escape_ascii().to_string()));
    }
    if long(8) != run {
        return Err(format!("run {:016x}, expected {run:016x}", long(8)));
    }
    if long(16) != state.len() as u64 {
        return Err(format!("{} bytes of state, expected {}", state.len(), long(16)));
    }
    let (start, expected) = (short(24), short(28));
    let found = checksum(start, state);
    if found != expected {
        return Err(format!("checksum {found:08x}, expected {expected:08x}"));
    }
    Ok((start, state))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn load(checkpoint: &Checkpoint) -> Option<Saved> {
        checkpoint.take_up(|saved| Ok::<_, String>(saved.clone()))
    }

    fn saved(state: &[u8], before_a_stop: bool) -> Option<Saved> {
        Some(Saved { state: state.to_vec(), before_a_stop })
    }

    #[test]
    fn what_is_saved_is_taken_up_and_what_is_damaged_is_put_aside() {
        let folder = tempfile::tempdir().expect("a folder");
        let checkpoint = Checkpoint::new(folder.path(), "mapping", 7, 0);
        assert_eq!(load(&checkpoint), None);
        checkpoint.save(b"first").expect("saved");
        checkpoint.save(b"second").expect("saved");
        assert_eq!(load(&checkpoint), saved(b"second", false));
        assert_eq!(load(&Checkpoint::new(folder.path(), "mapping", 7, 1)), saved(b"second", true));

        let whole = std::fs::read(&checkpoint.path).expect("readable");
        let mut aside = 0;
        for at in 0..whole.len() {
            for damaged in [whole[..at].to_vec(), {
                let mut b = whole.clone();
                b[at] ^= 1;
                b
            }] {
                std::fs::write(&checkpoint.path, &damaged).expect("written");
                assert_eq!(load(&checkpoint), None, "byte {at}");
                aside += 1;
                let kept = folder.path().join(format!("mapping.checkpoint-{aside}"));
                assert_eq!(std::fs::read(kept).expect("kept"), damaged);
            }
        }
    }

    #[test]
    fn another_run_is_refused_and_so_is_what_cannot_be_restored() {
        let folder = tempfile::tempdir().expect("a folder");
        let checkpoint = Checkpoint::new(folder.path(), "mapping", 7, 0);
        checkpoint.save(b"state").expect("saved");
        assert_eq!(load(&Checkpoint::new(folder.path(), "mapping", 8, 0)), None);
        checkpoint.save(b"state").expect("saved");
        assert_eq!(checkpoint.take_up(|_| Err::<(), _>("of another version")), None);
        assert_eq!(load(&checkpoint), None);
        assert_eq!(folder.path().read_dir().expect("readable").count(), 2, "both are kept");
    }
}
