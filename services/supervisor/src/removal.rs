//! What to do when another program removes files of a running deployment.
//!
//! Processes continue with the memory that they have mapped, but none can join any more: the next one that dies would be the last. So
//! all of them are killed and start again in new shared memory, from their checkpoints. Where these were removed, too, the processes
//! save them again on their own, and the restart waits for that.

use std::collections::BTreeSet;
use std::ffi::OsString;
use std::path::Path;

/// The checkpoints of a run, and what becomes of them.
#[derive(Debug, Default)]
pub(crate) struct Removal {
    /// Files of checkpoints when nothing was removed.
    checkpoints: BTreeSet<OsString>,
    /// How often was looked since something was found to be removed.
    looks: Option<u32>,
}

/// Looks before the restart: a program that removes many files may not be done at the first.
const LOOKS: u32 = 2;

impl Removal {
    /// Notes that everything is there, or is made again.
    pub(crate) fn nothing(&mut self, state: &Path) {
        *self = Self { checkpoints: checkpoints(state), looks: None };
    }

    /// Notes that something is removed; whether that is new.
    pub(crate) fn something(&mut self) -> bool {
        let is_new = self.looks.is_none();
        self.looks = Some(self.looks.unwrap_or(0) + 1);
        is_new
    }

    /// Whether something is removed.
    pub(crate) fn is_found(&self) -> bool {
        self.looks.is_some()
    }

    /// Whether every process that had a checkpoint has one.
    pub(crate) fn may_restart(&self, state: &Path) -> bool {
        self.looks.is_some_and(|looks| looks >= LOOKS) && self.is_complete(state)
    }

    /// Whether no checkpoint is missing.
    pub(crate) fn is_complete(&self, state: &Path) -> bool {
        self.checkpoints.is_subset(&checkpoints(state))
    }
}

fn checkpoints(state: &Path) -> BTreeSet<OsString> {
    let entries = std::fs::read_dir(state).into_iter().flatten().flatten();
    let names = entries.map(|entry| entry.file_name());
    names.filter(|name| Path::new(name).extension().is_some_and(|extension| extension == "checkpoint")).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_restart_waits_for_the_checkpoints_that_were_removed() {
        let state = tempfile::tempdir().unwrap();
        let file = |name: &str| state.path().join(name);
        let mut removal = Removal::default();
        ["std.checkpoint", "mapping.checkpoint", "run"].iter().for_each(|name| std::fs::write(file(name), "").unwrap());
        removal.nothing(state.path());
        assert!(!removal.may_restart(state.path()));
        ["std.checkpoint", "mapping.checkpoint", "run"].iter().for_each(|name| std::fs::remove_file(file(name)).unwrap());
        assert!(removal.something() && !removal.something());
        assert!(!removal.may_restart(state.path()));
        ["std.checkpoint", "mapping.checkpoint"].iter().for_each(|name| std::fs::write(file(name), "").unwrap());
        assert!(removal.may_restart(state.path()));
        removal.nothing(state.path());
        assert!(!removal.is_found());
    }
}
