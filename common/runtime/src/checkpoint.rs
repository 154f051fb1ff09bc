//! The state of a process in a file: written whole or not at all, checked when read.

use core::cell::{Cell, RefCell};
use core::fmt::Display;
use std::collections::BTreeMap;
use std::fs::{File, OpenOptions};
use std::io::{self, BufWriter, Seek, SeekFrom, Write};
use std::os::unix::fs::FileExt;
use std::path::{Path, PathBuf};
use std::rc::Rc;
use std::time::{Duration, Instant};

use bus::{Membership, make_private};
use serde::Serialize;
use serde::de::DeserializeOwned;
use state::{Schema, decode, encode};

use crate::aside::free_name;
use crate::journal::{PartKey, numbered_head, place_of, put_head, put_overwritten_preamble, put_part, put_preamble, read};

/// A checkpoint in parts is appended to until it is this much longer than twice what it was when it was written whole.
const APPENDED: u64 = 64 * 1024;
/// How often the file is looked for: a process that is killed in between, after its checkpoint was removed, begins anew.
const LOOK: Duration = Duration::from_millis(200);
/// What is written at once: a few parts of a map.
const BUFFER: usize = 64 * 1024;

/// The saved state of a process, which its next incarnation restores.
#[derive(Debug)]
pub struct Checkpoint {
    path: PathBuf,
    /// Where it is saved while writing to `path` fails, as on a full disk; removed with the deployment.
    fallback_path: Option<PathBuf>,
    run: u64,
    start: u32,
    /// How often the process has been started before since the deployment was.
    incarnation: u32,
    /// The file as this incarnation has left it.
    journal: Option<Journal>,
    /// Whether the file was there: saved by this incarnation, or found by it.
    was_there: Cell<bool>,
    /// When the file was last looked for.
    looked: Instant,
    save_error: SaveError,
}

/// Why the state cannot be saved to its path, in words, while that is so: shown in the status of the process.
pub(crate) type SaveError = Rc<RefCell<Option<String>>>;

/// A checkpoint as it was left.
#[derive(Debug, Clone, Copy)]
struct Journal {
    length: u64,
    then: Then,
}

/// How the next state is written into a file.
#[derive(Debug, Clone, Copy)]
enum Then {
    /// Appended, with the parts that have changed, until the file is much longer than this, which it was when it was written whole.
    Append { whole_length: u64 },
    /// In place of the state before the last one: a head with this number, in a record of this length.
    Overwrite { number: u64, record_length: u64 },
}

/// What an earlier incarnation has saved.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Snapshot<'a> {
    /// Its state, or the head of it.
    pub state: &'a [u8],
    /// The parts of its state, where it has such.
    pub parts: BTreeMap<PartKey, &'a [u8]>,
    /// The whole deployment has been stopped, or was killed, and started again since: streams that had ended continue.
    pub before_a_stop: bool,
}

/// State that grows with what was seen: parts of which few change from one checkpoint to the next.
pub trait Parts {
    /// The keys of those that have changed since this was last asked.
    fn take_changed(&mut self) -> Vec<PartKey>;
    /// The keys of all.
    fn all(&self) -> Vec<PartKey>;
    /// Appends a part to some bytes.
    fn write(&self, key: PartKey, bytes: &mut Vec<u8>);
}

impl Checkpoint {
    /// The checkpoint of a process in the folder of checkpoints of its run.
    pub(crate) fn of(membership: &Membership, save_error: SaveError) -> Self {
        let volatile = Self::volatile(membership, save_error);
        match membership.state() == membership.volatile_state() {
            true => volatile,
            false => Self { path: file(membership.state(), membership), fallback_path: Some(volatile.path), ..volatile },
        }
    }

    /// The checkpoint of a process in the folder that goes with the deployment.
    pub(crate) fn volatile(membership: &Membership, save_error: SaveError) -> Self {
        Self {
            path: file(&membership.volatile_state(), membership),
            fallback_path: None,
            run: membership.run(),
            start: membership.start(),
            incarnation: membership.incarnation(),
            journal: None,
            was_there: Cell::new(false),
            looked: Instant::now(),
            save_error,
        }
    }

    /// What `restore` makes of the snapshot of an earlier incarnation. `None` where there is none, or none that is valid: that
    /// is logged, and put under another name, where nothing writes over it. Where only what was added last is damaged, what was intact
    /// before is restored, and a copy put under another name.
    pub fn restore<T, E: Display>(&self, mut restore: impl FnMut(&Snapshot<'_>) -> Result<T, E>) -> Option<T> {
        // The fallback is newer while it exists: it is removed when the other file can be written again.
        let fallback_path = self.fallback_path.as_ref().and_then(|fallback_path| self.restore_from(fallback_path, &mut restore));
        fallback_path.or_else(|| self.restore_from(&self.path, &mut restore))
    }

    /// The state that [`save_state`](Self::save_state) saved, under the conditions of [`restore`](Self::restore).
    pub fn restore_state<T: DeserializeOwned + Schema>(&self) -> Option<T> {
        self.restore(|saved| decode(saved.state))
    }

    fn restore_from<T, E: Display>(&self, file: &Path, restore: impl FnOnce(&Snapshot<'_>) -> Result<T, E>) -> Option<T> {
        let path = file.display();
        let problem = match std::fs::read(file) {
            Err(error) if error.kind() == io::ErrorKind::NotFound => return None,
            Err(error) => error.to_string(),
            Ok(bytes) => match read(&bytes, self.run) {
                Err(damage) => damage,
                Ok(contents) => {
                    if let Some(damage) = contents.damage {
                        copy_aside(file, &damage);
                    }
                    let before_a_stop = self.incarnation == 0 || contents.start < self.start;
                    match restore(&Snapshot { state: contents.head, parts: contents.parts, before_a_stop }) {
                        Ok(restored) => {
                            self.was_there.set(true);
                            return Some(restored);
                        }
                        Err(error) => error.to_string(),
                    }
                }
            },
        };
        let aside = free_name(file);
        match std::fs::rename(file, &aside) {
            Ok(()) => tracing::error!("begins anew: {path} cannot be used ({problem}); it is kept as {}", aside.display()),
            Err(error) => tracing::error!("begins anew: {path} cannot be used ({problem}), and not be put aside: {error}"),
        }
        None
    }

    /// Whether the file is missing although it was there and can be written, as when a cleaner has removed its folder: then the
    /// state is saved at the next message, whatever the interval is. Looks at most five times a second.
    pub fn is_missing(&mut self) -> bool {
        if self.looked.elapsed() < LOOK {
            return false;
        }
        self.looked = Instant::now();
        self.was_there.get() && self.save_error.borrow().is_none() && !self.path.exists()
    }

    /// Replaces what was saved before. After a kill at any moment, either the old or the new state is there. Where the file system
    /// refuses, the state is kept in the deployment's own folder until it no longer does; both are said once, and in
    /// the status of the process.
    pub fn save(&mut self, state: &[u8]) {
        self.save_parts(state, &mut Whole);
    }

    /// As [`save`](Self::save), of a state without parts that is encoded with its version.
    pub fn save_state<T: Serialize + Schema>(&mut self, state: &T) {
        self.save(&encode(state, Vec::new()));
    }

    /// As [`save`](Self::save), of a state in parts: what is written grows with what has changed, not with all there is.
    pub fn save_parts(&mut self, head: &[u8], parts: &mut dyn Parts) {
        let saved = self.write(head, parts);
        let path = self.path.display();
        let mut save_error = self.save_error.borrow_mut();
        match saved {
            Ok(()) => {
                if save_error.take().is_some() {
                    tracing::info!("{path} is kept again");
                    self.fallback_path.iter().for_each(|fallback_path| drop(std::fs::remove_file(fallback_path)));
                }
            }
            Err(error) => {
                let fallback = self.fallback_path.as_ref().map(|fallback_path| self.replace(fallback_path, head, parts));
                let consequence = match fallback {
                    Some(Ok(_)) => "what is kept lasts until the deployment stops",
                    Some(Err(_)) | None => "a process that is killed now resumes from an older state",
                };
                if save_error.is_none() {
                    tracing::error!("{path}: {error}; {consequence}");
                }
                *save_error = Some(format!("its state cannot be kept: {error}"));
            }
        }
    }

    fn write(&mut self, head: &[u8], parts: &mut dyn Parts) -> io::Result<()> {
        // Where one of them fails, what has changed is no longer known: the next one is whole.
        let last = self.journal.take();
        let written = match last.and_then(|last| Some((self.open_as(last)?, last))) {
            Some((file, Journal { length, then: Then::Append { whole_length } })) if length < 2 * whole_length + APPENDED => {
                append(file, length, whole_length, head, parts)?
            }
            Some((file, Journal { length, then: Then::Overwrite { number, record_length } })) if parts.all().is_empty() => {
                let record = numbered_head(number, head)?;
                if record.len() as u64 == record_length {
                    overwrite(&file, length, number, &record)?
                } else {
                    self.replace(&self.path, head, parts)?
                }
            }
            _ => self.replace(&self.path, head, parts)?,
        };
        self.journal = Some(written);
        self.was_there.set(true);
        Ok(())
    }

    /// The file, if it is as this incarnation has left it.
    fn open_as(&self, journal: Journal) -> Option<File> {
        let file = OpenOptions::new().write(true).open(&self.path).ok()?;
        (file.metadata().ok()?.len() == journal.length).then_some(file)
    }

    fn replace(&self, path: &Path, head: &[u8], parts: &mut dyn Parts) -> io::Result<Journal> {
        if let Some(folder) = path.parent() {
            make_private(folder)?;
        }
        let fresh = path.with_extension("fresh");
        let written = write_whole(&fresh, (self.run, self.start), head, parts).and_then(|it| std::fs::rename(&fresh, path).map(|()| it));
        if written.is_err() {
            // On a full disk half a state takes the room of what is worth more.
            let _ = std::fs::remove_file(&fresh);
        }
        written
    }
}

/// Writes a new file. It is not synced: a process that waits for a disk is silent, and a power cut is what [`CheckpointSets`] are for.
///
/// [`CheckpointSets`]: crate::CheckpointSets
fn write_whole(fresh: &Path, (run, start): (u64, u32), head: &[u8], parts: &mut dyn Parts) -> io::Result<Journal> {
    let mut into = Counting { into: BufWriter::with_capacity(BUFFER, File::create(fresh)?), count: 0 };
    parts.take_changed();
    let all = parts.all();
    let then = if all.is_empty() {
        put_overwritten_preamble(&mut into, run, start)?;
        let record = numbered_head(0, head)?;
        into.write_all(&record)?;
        Then::Overwrite { number: 1, record_length: record.len() as u64 }
    } else {
        put_preamble(&mut into, run, start)?;
        put_state(&mut into, all, head, parts)?;
        Then::Append { whole_length: into.count }
    };
    into.flush()?;
    Ok(Journal { length: into.count, then })
}

fn file(folder: &Path, membership: &Membership) -> PathBuf {
    folder.join(format!("{}.checkpoint", membership.process()))
}

fn copy_aside(file: &Path, damage: &str) {
    let (path, aside) = (file.display(), free_name(file));
    match std::fs::copy(file, &aside) {
        Ok(_) => tracing::error!("{path} is damaged {damage}; resumes from the state before, a copy is {}", aside.display()),
        Err(error) => tracing::error!("{path} is damaged {damage}; resumes from the state before, without a copy: {error}"),
    }
}

/// Adds what has changed. Where that fails, the file is as it was.
fn append(mut file: File, length: u64, whole_length: u64, head: &[u8], parts: &mut dyn Parts) -> io::Result<Journal> {
    file.seek(SeekFrom::Start(length))?;
    let mut into = Counting { into: BufWriter::with_capacity(BUFFER, file), count: 0 };
    let changed = parts.take_changed();
    match put_state(&mut into, changed, head, parts).and_then(|()| into.flush()) {
        Ok(()) => Ok(Journal { length: length + into.count, then: Then::Append { whole_length } }),
        Err(error) => {
            let (file, _) = into.into.into_parts();
            let _ = file.set_len(length);
            Err(error)
        }
    }
}

/// Writes a head over the one before the last one. After a kill in the middle of it the last one is there.
fn overwrite(file: &File, length: u64, number: u64, record: &[u8]) -> io::Result<Journal> {
    let (record_length, at) = (record.len() as u64, place_of(number, record.len() as u64));
    file.write_all_at(record, at)?;
    Ok(Journal { length: length.max(at + record_length), then: Then::Overwrite { number: number + 1, record_length } })
}

fn put_state(into: &mut impl Write, keys: Vec<PartKey>, head: &[u8], parts: &dyn Parts) -> io::Result<()> {
    let mut part = Vec::new();
    for key in keys {
        part.clear();
        parts.write(key, &mut part);
        put_part(into, key, &part)?;
    }
    put_head(into, head)
}

/// A state without parts.
struct Whole;

impl Parts for Whole {
    fn take_changed(&mut self) -> Vec<PartKey> {
        Vec::new()
    }

    fn all(&self) -> Vec<PartKey> {
        Vec::new()
    }

    fn write(&self, _: PartKey, _: &mut Vec<u8>) {}
}

/// Counts what is written.
struct Counting<W> {
    into: W,
    count: u64,
}

impl<W: Write> Write for Counting<W> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let count = self.into.write(bytes)?;
        self.count += count as u64;
        Ok(count)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.into.flush()
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use std::os::unix::fs::MetadataExt;

    /// The checkpoint of a process that has been killed once, in a run that has been started `start` times before.
    pub(crate) fn checkpoint(state: &Path, process: &str, run: u64, start: u32) -> Checkpoint {
        let file = |folder: &Path| folder.join(format!("{process}.checkpoint"));
        let fallback_path = Some(file(&state.with_extension("domain").join("state")));
        Checkpoint {
            path: file(state),
            fallback_path,
            run,
            start,
            incarnation: 1,
            journal: None,
            was_there: Cell::new(false),
            looked: Instant::now(),
            save_error: SaveError::default(),
        }
    }

    pub(crate) type Loaded = (Vec<u8>, BTreeMap<PartKey, Vec<u8>>, bool);

    pub(crate) fn load(checkpoint: &Checkpoint) -> Option<Loaded> {
        let owned = |parts: &BTreeMap<PartKey, &[u8]>| parts.iter().map(|(key, part)| (*key, part.to_vec())).collect();
        checkpoint.restore(|saved| Ok::<_, String>((saved.state.to_vec(), owned(&saved.parts), saved.before_a_stop)))
    }

    /// Parts that are numbers, and how many were written.
    #[derive(Default)]
    pub(crate) struct Numbers {
        numbers: BTreeMap<PartKey, u64>,
        changed: Vec<PartKey>,
        written: Cell<usize>,
    }

    impl Numbers {
        pub(crate) fn set(&mut self, key: PartKey, number: u64) {
            self.numbers.insert(key, number);
            self.changed.push(key);
        }

        fn loaded(&self, head: &[u8]) -> Option<Loaded> {
            let parts = self.numbers.iter().map(|(key, number)| (*key, number.to_le_bytes().repeat(100))).collect();
            Some((head.to_vec(), parts, false))
        }
    }

    impl Parts for Numbers {
        fn take_changed(&mut self) -> Vec<PartKey> {
            std::mem::take(&mut self.changed)
        }

        fn all(&self) -> Vec<PartKey> {
            self.numbers.keys().copied().collect()
        }

        fn write(&self, key: PartKey, bytes: &mut Vec<u8>) {
            self.written.set(self.written.get() + 1);
            bytes.extend(self.numbers[&key].to_le_bytes().repeat(100));
        }
    }

    #[test]
    fn a_saved_state_is_restored_and_a_damaged_one_put_aside() {
        let out = tempfile::tempdir().expect("a folder");
        let folder = out.path().join("state");
        let mut checkpoint = checkpoint(&folder, "mapping", 7, 0);
        let mut numbers = Numbers::default();
        assert_eq!(load(&checkpoint), None);
        numbers.set([0, 0, 0], 1);
        checkpoint.save_parts(b"first", &mut numbers);
        let loaded_first = numbers.loaded(b"first");
        let before_a_stop = loaded_first.clone().map(|(head, parts, _)| (head, parts, true));
        assert_eq!(load(&self::checkpoint(&folder, "mapping", 7, 1)), before_a_stop);

        let first = std::fs::read(&checkpoint.path).expect("readable").len();
        checkpoint.save_parts(b"second", &mut numbers);
        assert_eq!(load(&checkpoint), numbers.loaded(b"second"));
        let intact = std::fs::read(&checkpoint.path).expect("readable");
        assert!(intact.len() > first, "appended to");
        let mut aside = 0;
        for at in 0..intact.len() {
            let cut = intact[..at].to_vec();
            let mut turned = intact.clone();
            turned[at] ^= 1;
            for damaged in [cut, turned] {
                std::fs::write(&checkpoint.path, &damaged).expect("written");
                let expected = if at < first { &None } else { &loaded_first };
                assert_eq!(load(&checkpoint), *expected, "byte {at}");
                let aside_path = folder.join(format!("mapping.checkpoint-{}", aside + 1));
                // An end that is missing, as a kill leaves it, is nothing to look at.
                let is_cut = at >= first && !aside_path.exists();
                if !is_cut {
                    aside += 1;
                    assert_eq!(std::fs::read(aside_path).expect("kept"), damaged);
                }
            }
        }
        assert!(aside > 2 * first, "what was damaged behind the first state was copied, too");
    }

    #[test]
    fn an_overwritten_state_leaves_the_one_before() {
        let out = tempfile::tempdir().expect("a folder");
        let folder = out.path().join("state");
        let mut checkpoint = checkpoint(&folder, "mapping", 7, 0);
        let inode = |checkpoint: &Checkpoint| std::fs::metadata(&checkpoint.path).expect("there").ino();
        checkpoint.save(b"0");
        let (first, mut before) = (inode(&checkpoint), std::fs::read(&checkpoint.path).expect("readable"));
        for head in [b"1", b"2", b"3", b"4"] {
            checkpoint.save(head);
            assert_eq!(load(&checkpoint), Some((head.to_vec(), BTreeMap::new(), false)));
            let after = std::fs::read(&checkpoint.path).expect("readable");
            // Only one of the two has changed.
            let record = numbered_head(0, head).expect("memory").len();
            let changed: Vec<usize> = (0..before.len()).filter(|at| before[*at] != after[*at]).map(|at| (at - 24) / record).collect();
            assert!(changed.iter().all(|slot| *slot == changed[0]), "{changed:?}");
            before = after;
        }
        assert_eq!(inode(&checkpoint), first);
        assert_eq!(before.len(), 24 + 2 * numbered_head(0, b"0").expect("memory").len());
        checkpoint.save(b"a longer one");
        assert_eq!(load(&checkpoint), Some((b"a longer one".to_vec(), BTreeMap::new(), false)));
        assert_ne!(inode(&checkpoint), first, "another file");
    }

    #[test]
    fn a_damaged_last_state_without_parts_leaves_the_one_before() {
        let out = tempfile::tempdir().expect("a folder");
        let folder = out.path().join("state");
        let mut checkpoint = checkpoint(&folder, "mapping", 7, 0);
        for last in 1..=4_u8 {
            checkpoint.save(&[100 + last]);
            let intact = std::fs::read(&checkpoint.path).expect("readable");
            let at = intact.iter().rposition(|byte| *byte == 100 + last).expect("its byte");
            let mut damaged = intact.clone();
            damaged[at] ^= 0x80;
            std::fs::write(&checkpoint.path, &damaged).expect("written");
            let expected = (last > 1).then(|| (vec![99 + last], BTreeMap::new(), false));
            assert_eq!(load(&checkpoint), expected, "state {last}");
            std::fs::write(&checkpoint.path, &intact).expect("written");
        }
    }

    #[test]
    fn another_run_is_refused_and_so_is_what_cannot_be_restored() {
        let out = tempfile::tempdir().expect("a folder");
        let folder = out.path().join("state");
        let mut checkpoint = checkpoint(&folder, "mapping", 7, 0);
        checkpoint.save(b"state");
        assert_eq!(load(&self::checkpoint(&folder, "mapping", 8, 0)), None);
        checkpoint.save(b"state");
        assert_eq!(checkpoint.restore(|_| Err::<(), _>("of another version")), None);
        assert_eq!(load(&checkpoint), None);
        assert_eq!(folder.read_dir().expect("readable").count(), 2, "both are kept");
    }

    #[test]
    fn only_changed_parts_are_appended_and_the_file_stays_bounded() {
        let out = tempfile::tempdir().expect("a folder");
        let folder = out.path().join("state");
        let mut checkpoint = checkpoint(&folder, "mapping", 7, 0);
        let mut numbers = Numbers::default();
        (0..1000).for_each(|column| numbers.set([0, 0, column], 1));
        checkpoint.save_parts(b"0", &mut numbers);
        let first_length = std::fs::metadata(&checkpoint.path).expect("there").len();
        assert_eq!(numbers.written.replace(0), 1000);
        for round in 1..=500_i32 {
            numbers.set([0, 0, round], 2);
            numbers.set([1, round, 0], 3);
            let head = round.to_string();
            checkpoint.save_parts(head.as_bytes(), &mut numbers);
            assert!(round > 1 || numbers.written.get() == 2, "{}", numbers.written.get());
            if round % 50 < 2 {
                assert_eq!(load(&checkpoint), numbers.loaded(head.as_bytes()), "round {round}");
            }
        }
        assert!(numbers.written.get() < 2 * 500 + 2000, "{}", numbers.written.get());
        let length = std::fs::metadata(&checkpoint.path).expect("there").len();
        assert!(length < 3 * first_length + 2 * APPENDED, "{first_length} {length}");
        assert_eq!(folder.read_dir().expect("readable").count(), 1);
    }

    #[test]
    fn what_was_taken_away_is_written_whole_again() {
        let out = tempfile::tempdir().expect("a folder");
        let folder = out.path().join("state");
        let mut checkpoint = checkpoint(&folder, "mapping", 7, 0);
        let mut numbers = Numbers::default();
        (0..10).for_each(|column| numbers.set([0, 0, column], 1));
        checkpoint.save_parts(b"first", &mut numbers);
        std::fs::remove_dir_all(&folder).expect("removed");
        numbers.set([0, 0, 3], 4);
        checkpoint.save_parts(b"second", &mut numbers);
        assert_eq!(load(&checkpoint), numbers.loaded(b"second"));

        std::fs::write(&checkpoint.path, b"of another program").expect("written");
        checkpoint.save_parts(b"third", &mut numbers);
        assert_eq!(load(&checkpoint), numbers.loaded(b"third"));
    }

    #[test]
    fn a_removed_file_is_missing_until_it_is_saved_again() {
        let out = tempfile::tempdir().expect("a folder");
        let folder = out.path().join("state");
        let mut checkpoint = checkpoint(&folder, "mapping", 7, 0);
        let is_missing = |checkpoint: &mut Checkpoint| {
            checkpoint.looked -= LOOK;
            checkpoint.is_missing()
        };
        assert!(!is_missing(&mut checkpoint), "it was never there");
        checkpoint.save(b"first");
        assert!(!is_missing(&mut checkpoint));
        std::fs::remove_dir_all(&folder).expect("removed");
        assert!(is_missing(&mut checkpoint));
        assert!(!checkpoint.is_missing(), "it has just been looked for");
        checkpoint.save(b"second");
        assert!(!is_missing(&mut checkpoint));
        std::fs::remove_dir_all(&folder).expect("removed");
        *checkpoint.save_error.borrow_mut() = Some("the disk is full".to_owned());
        assert!(!is_missing(&mut checkpoint), "it cannot be saved");
    }

    #[test]
    fn a_refused_write_saves_the_state_with_the_deployment() {
        let out = tempfile::tempdir().expect("a folder");
        let folder = out.path().join("state");
        let mut checkpoint = checkpoint(&folder, "mapping", 7, 0);
        let mut numbers = Numbers::default();
        numbers.set([0, 0, 0], 1);
        numbers.set([0, 0, 1], 1);
        checkpoint.save_parts(b"first", &mut numbers);
        assert_eq!(*checkpoint.save_error.borrow(), None);
        // A file in the place of the folder.
        let away = out.path().join("away");
        std::fs::rename(&folder, &away).expect("renamed");
        std::fs::write(&folder, b"").expect("written");
        for (head, number) in [(b"second", 2), (b"third ", 3)] {
            numbers.set([0, 0, 1], number);
            checkpoint.save_parts(head, &mut numbers);
            assert_eq!(load(&self::checkpoint(&folder, "mapping", 7, 0)), numbers.loaded(head));
            assert!(checkpoint.save_error.borrow().as_ref().is_some_and(|words| words.starts_with("its state cannot be kept: ")));
        }
        std::fs::remove_file(&folder).expect("removed");
        std::fs::rename(&away, &folder).expect("renamed");
        assert_eq!(load(&self::checkpoint(&folder, "mapping", 7, 0)), numbers.loaded(b"third "), "not the older one that is there again");
        checkpoint.save_parts(b"fourth", &mut numbers);
        assert_eq!((load(&checkpoint), &*checkpoint.save_error.borrow()), (numbers.loaded(b"fourth"), &None));
        assert_eq!(out.path().join("state.domain/state").read_dir().expect("readable").count(), 0, "what was spare is gone");
    }
}
