//! Where the checkpoints of a run lie, and whether an earlier run is resumed.
//!
//! Checkpoints that outlive the deployment lie in a folder beside its outputs, with a note of whose they are. A deployment that
//! finds a note of its own resumes that run, as if all of its processes had been killed at once. They resume together or not
//! at all: a driver that began anew beside a map that did not would draw into it at another place.

use std::cell::Cell;
use std::fs::File;
use std::io;
use std::path::{Path, PathBuf};

use bus::{Claim, Domain, DomainError, Run, make_private};

use crate::aside::free_name;
use crate::checkpoint_set;
use crate::journal::read;
use crate::note::{NOTE, Note};

/// The file that is there while the run is running, with the id of the computer's boot.
const RUNNING: &str = "running";
/// The id of this boot (random(4)).
const BOOT_ID: &str = "/proc/sys/kernel/random/boot_id";
/// Stamps of a run may be so much later than its last note, s of the wall clock: notes are taken every second or so.
const UNNOTED_S: f64 = 3.0;
/// The same where the computer stopped: Linux stores after 30 s what a program has written, and looks every 5 s (`vm.dirty_expire_centisecs`,
/// `vm.dirty_writeback_centisecs`). The log may have reached the disk and the last notes not.
const UNNOTED_AFTER_CUT_S: f64 = UNNOTED_S + 35.0;

/// Where checkpoints outlive the deployment.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PersistedState<'a> {
    /// The folder.
    pub folder: &'a Path,
    /// What they depend on, in words: a run is resumed only where these are the same.
    pub made_with: &'a str,
    /// What is there is put aside, and a new run begins.
    pub fresh: bool,
}

/// The checkpoints of a run.
#[derive(Debug)]
pub struct RunState {
    folder: PathBuf,
    note: Note,
    /// How often it was written.
    noted: Cell<u64>,
    outlives: bool,
    /// The computer stopped while the run was running.
    computer_stopped: bool,
}

impl RunState {
    /// Opens the domain of this name with a clock that runs `speed` times faster than the wall; what is sent on the services named
    /// in `routed` goes to the process that taps it. `kept` says where checkpoints outlive the deployment, if they do: the run that
    /// was there last goes on then, under its own number and with a clock that is not behind it.
    ///
    /// # Errors
    /// When a supervisor holds the domain, processes of an earlier run are alive, or memory or the file system refuse.
    pub fn open(name: &str, speed: f64, routed: &[&str], persisted: Option<PersistedState<'_>>) -> Result<(Self, Domain), DomainError> {
        let claim = Claim::take(name, speed)?;
        let new_run = claim.new_run();
        let state = match persisted {
            None => Self::of_the_run(&new_run),
            Some(persisted) => Self::restore(persisted, name, new_run.number)
                .map_err(|source| DomainError::Io { path: persisted.folder.to_owned(), source })?,
        };
        let unnoted_s = if state.computer_stopped { UNNOTED_AFTER_CUT_S } else { UNNOTED_S };
        let unnoted_ns = (unnoted_s * claim.clock().speed() * 1e9) as u64;
        let not_before_ns = state.note.last_ns.saturating_add(unnoted_ns);
        let run = Run { number: state.note.run, start: state.note.start, state: state.folder.clone(), not_before_ns };
        let domain = claim.open(run, routed)?;
        if let Err(error) = state.note_time(domain.clock().now_ns()) {
            tracing::warn!("{error}: the next start may resume with a clock that is behind");
        }
        // After the note: a folder without one is no run's.
        if let Err(error) = state.note_begin() {
            tracing::warn!("{}: {error}: a power cut will not be noticed", state.folder.join(RUNNING).display());
        }
        Ok((state, domain))
    }

    /// Whether this is an earlier run that is resumed.
    #[must_use]
    pub fn is_resumed(&self) -> bool {
        self.note.start > 0
    }

    /// Whether the computer stopped, as in a power cut, while the run was running: what had not reached the disk is lost.
    #[must_use]
    pub fn computer_stopped(&self) -> bool {
        self.computer_stopped
    }

    /// Notes that the run has ended and everything of it is on the disk.
    ///
    /// # Errors
    /// When the file system refuses.
    pub fn note_end(&self) -> Result<(), DomainError> {
        let path = self.folder.join(RUNNING);
        let removed = match std::fs::remove_file(&path) {
            Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(()),
            removed => removed.and_then(|()| File::open(&self.folder)?.sync_all()),
        };
        removed.map_err(|source| DomainError::Io { path, source })
    }

    /// Keeps how late it is in the deployment for the next start of the run; to be called every second or so.
    ///
    /// # Errors
    /// When the file system refuses.
    pub fn note_time(&self, now_ns: u64) -> Result<(), DomainError> {
        self.write_note(now_ns).map_err(|source| DomainError::Io { path: self.folder.clone(), source })
    }

    /// Checkpoints that go when the deployment does.
    fn of_the_run(run: &Run) -> Self {
        let note = Note { name: String::new(), made_with: 0, run: run.number, start: 0, last_ns: 0 };
        Self { folder: run.state.clone(), note, noted: Cell::new(0), outlives: false, computer_stopped: false }
    }

    /// Checkpoints that outlive the deployment: those of its last run, or else none, for a new one with the number `new_run`.
    fn restore(persisted: PersistedState<'_>, name: &str, new_run: u64) -> io::Result<Self> {
        let folder = persisted.folder.to_owned();
        let mut note =
            Note { name: name.to_owned(), made_with: crc32fast::hash(persisted.made_with.as_bytes()), run: new_run, start: 0, last_ns: 0 };
        let was_cut = was_running_in_another_boot(&folder);
        match usable(persisted, &note, was_cut)? {
            Found::Nothing => make_private(&folder)?,
            Found::Run(last) => note = Note { start: last.start.saturating_add(1), ..last },
            Found::Unusable(reason) => {
                let aside = free_name(&folder);
                std::fs::rename(&folder, &aside)?;
                tracing::warn!("a new run begins: {reason}; what was in {} is kept as {}", folder.display(), aside.display());
                make_private(&folder)?;
            }
        }
        let computer_stopped = note.start > 0 && was_cut;
        Ok(Self { folder, note, noted: Cell::new(0), outlives: true, computer_stopped })
    }

    /// Notes on the disk that the run is running.
    fn note_begin(&self) -> io::Result<()> {
        if !self.outlives {
            return Ok(());
        }
        std::fs::write(self.folder.join(RUNNING), std::fs::read(BOOT_ID)?)?;
        // Also the last set of checkpoints, which a supervisor that was killed may have begun to sync.
        rustix::fs::syncfs(File::open(&self.folder)?)?;
        Ok(())
    }

    /// Notes how late it is, where the next start will look.
    fn write_note(&self, now_ns: u64) -> io::Result<()> {
        if !self.outlives {
            return Ok(());
        }
        let note = Note { last_ns: now_ns, ..self.note.clone() };
        let number = self.noted.replace(self.noted.get() + 1);
        if number == 0 { note.write(&self.folder) } else { note.write_time(&self.folder, number) }
    }
}

/// Whether a run was running in this folder when the computer stopped.
fn was_running_in_another_boot(folder: &Path) -> bool {
    let this_boot = std::fs::read(BOOT_ID).ok();
    std::fs::read(folder.join(RUNNING)).is_ok_and(|boot| this_boot.is_some_and(|this_boot| boot != this_boot))
}

enum Found {
    Nothing,
    Run(Note),
    Unusable(String),
}

fn usable(persisted: PersistedState<'_>, expected: &Note, was_cut: bool) -> io::Result<Found> {
    let folder = persisted.folder;
    let is_empty = match folder.read_dir() {
        Ok(mut entries) => entries.next().is_none(),
        Err(error) if error.kind() == io::ErrorKind::NotFound => true,
        Err(error) => return Err(error),
    };
    if is_empty {
        return Ok(Found::Nothing);
    }
    // A start replaces the note before it notes that the run is running: a cut in between leaves only a note that is empty.
    let is_cut = was_cut || Note::read(folder)?.is_none();
    let is_restored = is_cut && !persisted.fresh && checkpoint_set::restore(folder)?;
    if was_cut && !persisted.fresh && !is_restored {
        return Ok(Found::Unusable("the computer stopped before a state of the last one was on the disk".to_owned()));
    }
    let Some(note) = Note::read(folder)? else {
        return Ok(Found::Unusable(format!("{} is no note of a run", folder.join(NOTE).display())));
    };
    let reason = if persisted.fresh {
        "that was asked for".to_owned()
    } else if note.name != expected.name {
        format!("the last one was of deployment {}", note.name)
    } else if note.made_with != expected.made_with {
        "the map of the last one was made with other settings of [robot] or [mapping]".to_owned()
    } else {
        match damage(folder, note.run)? {
            None => return Ok(Found::Run(note)),
            Some(damage) => damage,
        }
    };
    Ok(Found::Unusable(reason))
}

/// What is wrong with the checkpoints of a run, if anything is.
fn damage(folder: &Path, run: u64) -> io::Result<Option<String>> {
    for entry in folder.read_dir()? {
        let path = entry?.path();
        if path.extension().is_some_and(|extension| extension == "checkpoint")
            && let Err(reason) = read(&std::fs::read(&path)?, run)
        {
            return Ok(Some(format!("{} is no checkpoint of the last one ({reason})", path.display())));
        }
    }
    Ok(None)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::CheckpointSets;
    use crate::checkpoint::tests::checkpoint;

    fn begin(folder: &Path, name: &str, made_with: &str, fresh: bool, run: u64) -> RunState {
        let state = RunState::restore(PersistedState { folder, made_with, fresh }, name, run).expect("taken up");
        state.write_note(1_000 * (run + 1)).expect("noted");
        checkpoint(folder, "mapping", state.note.run, state.note.start).save(b"map");
        state
    }

    #[test]
    fn a_run_is_resumed_from_start_to_start() {
        let out = tempfile::tempdir().expect("a folder");
        let folder = out.path().join("state");
        let starts = [7, 8, 9].map(|run| begin(&folder, "robot", "cells of 0.1 m", false, run));
        let found = starts.each_ref().map(|state| (state.note.run, state.note.start, state.note.last_ns));
        assert_eq!(found, [(7, 0, 0), (7, 1, 8_000), (7, 2, 9_000)]);
        assert_eq!(out.path().read_dir().expect("readable").count(), 1, "nothing is put aside");
    }

    #[test]
    fn a_foreign_damaged_or_unwanted_state_is_put_aside() {
        type Change = fn(&Path);
        let cases: [(&str, &str, bool, Change); 6] = [
            ("robot", "cells of 0.1 m", true, |_| ()),
            ("other", "cells of 0.1 m", false, |_| ()),
            ("robot", "cells of 0.2 m", false, |_| ()),
            ("robot", "cells of 0.1 m", false, |folder| std::fs::write(folder.join("std.checkpoint"), b"none").expect("written")),
            ("robot", "cells of 0.1 m", false, |folder| std::fs::write(folder.join(NOTE), [0xff, 0x00]).expect("written")),
            ("robot", "cells of 0.1 m", false, |folder| std::fs::remove_file(folder.join(NOTE)).expect("removed")),
        ];
        for (at, (name, made_with, fresh, change)) in cases.into_iter().enumerate() {
            let out = tempfile::tempdir().expect("a folder");
            let folder = out.path().join("state");
            for times in 1..=2 {
                begin(&folder, "robot", "cells of 0.1 m", true, 7);
                change(&folder);
                let new = begin(&folder, name, made_with, fresh, 8);
                assert_eq!((new.note.run, new.note.start, new.note.last_ns), (8, 0, 0), "case {at}");
                assert!(out.path().join(format!("state-{times}/mapping.checkpoint")).exists(), "case {at}: what was there is kept");
                std::fs::remove_dir_all(&folder).expect("removed");
            }
        }
    }

    #[test]
    fn a_run_that_another_boot_has_not_ended_was_cut() {
        let out = tempfile::tempdir().expect("a folder");
        let folder = out.path().join("state");
        let was_cut = |run| begin(&folder, "robot", "cells of 0.1 m", false, run).computer_stopped();
        assert!(!was_cut(1), "a new run");
        assert!(!was_cut(2), "one that has ended");
        let state = begin(&folder, "robot", "cells of 0.1 m", false, 3);
        state.note_begin().expect("noted");
        assert!(!was_cut(4), "one that was killed in this boot");
        let run = state.note.run;
        CheckpointSets::open(&folder, out.path(), Vec::new()).and_then(|sets| sets.write()).expect("written");
        let cut = || std::fs::write(folder.join(RUNNING), "the id of another boot\n").expect("written");
        cut();
        // As a power cut leaves what replaced the files since the sync.
        for name in ["mapping.checkpoint", NOTE] {
            std::fs::remove_file(folder.join(name)).and_then(|()| std::fs::write(folder.join(name), [0; 50])).expect("written");
        }
        let state = begin(&folder, "robot", "cells of 0.1 m", false, 5);
        assert!(state.computer_stopped());
        assert_eq!((state.note.run, out.path().read_dir().expect("readable").count()), (run, 1), "resumed");
        state.note_end().expect("noted");
        assert!(!was_cut(6));
        state.note_end().expect("it is not there");
        // Cut while the next start had replaced the note and not yet noted that it runs.
        std::fs::remove_file(folder.join(NOTE)).and_then(|()| std::fs::write(folder.join(NOTE), [0; 50])).expect("written");
        assert_eq!(begin(&folder, "robot", "cells of 0.1 m", false, 6).note.run, run, "resumed");
        cut();
        ["set-0", "set-1"].iter().for_each(|set| drop(std::fs::remove_dir_all(folder.join(set))));
        let state = begin(&folder, "robot", "cells of 0.1 m", false, 7);
        assert_eq!((state.note.run, state.computer_stopped()), (7, false), "a new one: nothing was on the disk");
        assert!(out.path().join("state-1/mapping.checkpoint").exists());
    }
}
