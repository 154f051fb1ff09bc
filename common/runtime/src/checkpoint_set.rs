//! Sets of checkpoints that a power cut leaves intact.
//!
//! The processes of a run write their checkpoints without waiting for the disk, so that after a power cut each of these files may be old,
//! empty or torn. Every few seconds the supervisor therefore adds all of them to a set and syncs the file system. What is in a set changes
//! no more: what is appended to is linked, and the list of the set has the length; what is overwritten in place is copied. Two sets alternate, so
//! that one of them is on the disk while the other one is written.
//!
//! Consumers are added before their sources: a map in a set has no scan that the driver in the set has not numbered yet.

use std::ffi::OsString;
use std::fs::File;
use std::io::{self, Read};
use std::path::{Path, PathBuf};

use crate::journal::{is_overwritten, length_with_head, put_head, put_preamble, read};
use crate::note::{NOTE, Note};

/// The two folders, within that of the checkpoints.
const FOLDERS: [&str; 2] = ["set-0", "set-1"];
/// The file in each that makes it valid.
const LIST: &str = "list";
/// What a list begins with.
const MAGIC: &str = "stillmap checkpoints 1";
/// The end of a checkpoint's name.
const EXTENSION: &str = "checkpoint";

/// The sets of a run, as the supervisor adds to them.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct CheckpointSets {
    folder: PathBuf,
    fallback_folder: PathBuf,
    sources: Vec<String>,
    /// The number of the next set.
    next: u64,
}

/// What a list says.
#[derive(Debug, Clone, PartialEq, Eq)]
struct List {
    /// Later sets have higher numbers.
    number: u64,
    files: Vec<Listed>,
    /// The note of the run.
    note: Note,
}

/// A checkpoint in a list.
#[derive(Debug, Clone, PartialEq, Eq)]
struct Listed {
    name: String,
    /// Bytes that count: what a process appended later does not.
    length: u64,
    /// CRC-32 of these bytes. After a cut a file system without a journal may show the file of an older set under this name.
    checksum: u32,
}

/// A set that is on the disk completely.
struct Intact {
    folder: PathBuf,
    list: List,
}

impl CheckpointSets {
    /// The sets in a folder of checkpoints, to be called while all that is in it is on the disk. The checkpoints of the processes `sources` are
    /// added last. A process that cannot write its checkpoint writes it into `fallback_folder`.
    ///
    /// # Errors
    /// When the file system refuses.
    pub fn open(folder: &Path, fallback_folder: &Path, sources: Vec<String>) -> io::Result<Self> {
        let next = newest(folder)?.map_or(0, |set| set.list.number + 1);
        Ok(Self { folder: folder.to_owned(), fallback_folder: fallback_folder.to_owned(), sources, next })
    }

    /// Adds the checkpoints as they are to a set. It counts once the file system is synced: then the next one is written by what this returns.
    ///
    /// # Errors
    /// When the file system refuses, or a process could not write its checkpoint: the set before stays.
    pub fn write(&self) -> io::Result<Self> {
        self.write_with(|from, to| std::fs::hard_link(from, to))
    }

    fn write_with(&self, link: impl Fn(&Path, &Path) -> io::Result<()>) -> io::Result<Self> {
        let set = self.folder.join(FOLDERS[usize::from(!self.next.is_multiple_of(2))]);
        match std::fs::remove_dir_all(&set) {
            Err(error) if error.kind() != io::ErrorKind::NotFound => return Err(error),
            _ => std::fs::create_dir(&set)?,
        }
        let note = Note::read(&self.folder)?.ok_or_else(|| io::Error::other(format!("{} is no note", self.folder.join(NOTE).display())))?;
        let mut files = Vec::new();
        for name in self.in_order()? {
            let from = self.folder.join(&name);
            if self.fallback_folder.join(&name).exists() {
                return Err(io::Error::other(format!("{} could not be written, and is old", from.display())));
            }
            let (length, checksum) = add(&from, &set.join(&name), note.run, &link)?;
            files.push(Listed { name, length, checksum });
        }
        std::fs::write(set.join(LIST), List { number: self.next, files, note }.to_text())?;
        Ok(Self { next: self.next + 1, ..self.clone() })
    }

    /// The names of the checkpoints, sources last.
    fn in_order(&self) -> io::Result<Vec<String>> {
        let of_a_source = |name: &String| self.sources.iter().any(|source| *name == format!("{source}.{EXTENSION}"));
        let mut names = checkpoints(&self.folder)?
            .into_iter()
            .map(OsString::into_string)
            .collect::<Result<Vec<_>, _>>()
            .map_err(|name| io::Error::other(format!("{} is no name of a process", name.display())))?;
        names.sort_by_key(of_a_source);
        Ok(names)
    }
}

/// Adds a checkpoint to a set under the name `to`: what counts of it, with its checksum.
fn add(from: &Path, to: &Path, run: u64, link: impl Fn(&Path, &Path) -> io::Result<()>) -> io::Result<(u64, u32)> {
    // FAT has no links.
    link(from, to).or_else(|_| std::fs::copy(from, to).map(drop))?;
    // Looked at here: meanwhile the process may have replaced its checkpoint by one of the other kind.
    if is_overwritten(&File::open(to)?)? {
        freeze(to, run)?;
    }
    let file = File::open(to)?;
    let length = length_with_head(&file)?.ok_or_else(|| io::Error::other(format!("{} is no checkpoint", from.display())))?;
    Ok((length, checksum(&file, length)?))
}

/// Replaces what may be overwritten meanwhile by a copy of its state.
fn freeze(path: &Path, run: u64) -> io::Result<()> {
    let bytes = std::fs::read(path)?;
    let contents = read(&bytes, run).map_err(|problem| io::Error::other(format!("{}: {problem}", path.display())))?;
    let mut copy = Vec::with_capacity(bytes.len());
    put_preamble(&mut copy, run, contents.start)?;
    put_head(&mut copy, contents.head)?;
    std::fs::remove_file(path)?;
    std::fs::write(path, copy)
}

/// CRC-32 of the first bytes of a file.
fn checksum(file: &File, length: u64) -> io::Result<u32> {
    let (mut hasher, mut left) = (crc32fast::Hasher::new(), file.take(length));
    let mut bytes = vec![0; 64 * 1024];
    loop {
        match left.read(&mut bytes)? {
            0 => return Ok(hasher.finalize()),
            count => hasher.update(&bytes[..count]),
        }
    }
}

/// Replaces the checkpoints in a folder, and the note, by those of the newest intact set; false if there is none. Once called, it has to be
/// called again after a kill in the middle of it.
pub(crate) fn restore(folder: &Path) -> io::Result<bool> {
    let Some(Intact { folder: set, list }) = newest(folder)? else { return Ok(false) };
    for name in checkpoints(folder)? {
        std::fs::remove_file(folder.join(name))?;
    }
    for Listed { name, length, .. } in &list.files {
        let (from, to) = (set.join(name), folder.join(name));
        // The set may be needed again before the next one is on the disk. A link takes no room on a full disk, and no process writes into a
        // checkpoint that it has found.
        std::fs::hard_link(&from, &to).or_else(|_| std::fs::copy(&from, &to).map(drop))?;
        File::options().write(true).open(&to)?.set_len(*length)?;
    }
    // Last: a note that cannot be read has this called again.
    later(list.note, Note::read(folder)?).write(folder)?;
    Ok(true)
}

/// The note of a set, no earlier than the one that was taken every second since, where that one is of the same run.
fn later(of_the_set: Note, live: Option<Note>) -> Note {
    match live.filter(|live| live.run == of_the_set.run) {
        Some(live) => Note { start: of_the_set.start.max(live.start), last_ns: of_the_set.last_ns.max(live.last_ns), ..of_the_set },
        None => of_the_set,
    }
}

/// The names of the checkpoints in a folder.
fn checkpoints(folder: &Path) -> io::Result<Vec<OsString>> {
    let names: Vec<OsString> = folder.read_dir()?.map(|entry| Ok(entry?.file_name())).collect::<io::Result<_>>()?;
    Ok(names.into_iter().filter(|name| Path::new(name).extension().is_some_and(|extension| extension == EXTENSION)).collect())
}

/// The intact set with the highest number.
fn newest(folder: &Path) -> io::Result<Option<Intact>> {
    let mut sets = Vec::new();
    for name in FOLDERS {
        sets.extend(intact(folder.join(name))?);
    }
    Ok(sets.into_iter().max_by_key(|set| set.list.number))
}

/// The set in a folder, if all of it is as it was written.
fn intact(folder: PathBuf) -> io::Result<Option<Intact>> {
    let Some(list) = read_or_missing(&folder.join(LIST))?.and_then(|text| List::parse(std::str::from_utf8(&text).ok()?)) else {
        return Ok(None);
    };
    for Listed { name, length, checksum } in &list.files {
        let Some(bytes) = read_or_missing(&folder.join(name))? else { return Ok(None) };
        let Some(counted) = usize::try_from(*length).ok().and_then(|length| bytes.get(..length)) else { return Ok(None) };
        let is_as_written = crc32fast::hash(counted) == *checksum;
        if !is_as_written || read(counted, list.note.run).map_or(true, |contents| contents.damage.is_some()) {
            return Ok(None);
        }
    }
    Ok(Some(Intact { folder, list }))
}

fn read_or_missing(path: &Path) -> io::Result<Option<Vec<u8>>> {
    match std::fs::read(path) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(None),
        read => read.map(Some),
    }
}

impl List {
    fn to_text(&self) -> String {
        let Self { number, files, note } = self;
        let line = |Listed { name, length, checksum }: &Listed| format!("{length} {checksum:08x} {name}\n");
        let files: String = files.iter().map(line).collect();
        let text = format!("{MAGIC}\n{number}\n{files}\n{}", note.to_text());
        let checksum = crc32fast::hash(text.as_bytes());
        format!("{text}{checksum:08x}\n")
    }

    fn parse(text: &str) -> Option<Self> {
        let (text, checksum) = text.strip_suffix('\n')?.rsplit_once('\n').map(|(text, checksum)| (format!("{text}\n"), checksum))?;
        if u32::from_str_radix(checksum, 16).ok()? != crc32fast::hash(text.as_bytes()) {
            return None;
        }
        let (head, note) = text.split_once("\n\n")?;
        let mut lines = head.lines();
        if lines.next()? != MAGIC {
            return None;
        }
        let number = lines.next()?.parse().ok()?;
        let file = |line: &str| {
            let (length, rest) = line.split_once(' ')?;
            let (checksum, name) = rest.split_once(' ')?;
            let (length, checksum) = (length.parse().ok()?, u32::from_str_radix(checksum, 16).ok()?);
            // A name, and no path to elsewhere.
            (Path::new(name).file_name()? == name).then(|| Listed { name: name.to_owned(), length, checksum })
        };
        Some(Self { number, files: lines.map(file).collect::<Option<_>>()?, note: Note::parse(note)? })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::checkpoint::tests::{Numbers, checkpoint, load};
    use proptest::prelude::*;

    const RUN: u64 = 7;

    /// A run of a map in parts and a driver, both with the number of the last scan as their head.
    struct Run {
        out: tempfile::TempDir,
        map: crate::Checkpoint,
        driver: crate::Checkpoint,
        tiles: Numbers,
    }

    impl Run {
        fn new() -> Self {
            let out = tempfile::tempdir().unwrap();
            let folder = out.path().join("state");
            let (map, driver) = (checkpoint(&folder, "mapping", RUN, 0), checkpoint(&folder, "pioneer", RUN, 0));
            Self { out, map, driver, tiles: Numbers::default() }
        }

        fn folder(&self) -> PathBuf {
            self.out.path().join("state")
        }

        fn sets(&self) -> CheckpointSets {
            CheckpointSets::open(&self.folder(), &self.out.path().join("fallback"), vec!["pioneer".to_owned()]).unwrap()
        }

        /// Both processes and the supervisor work on to this scan.
        fn save(&mut self, scan: u64) {
            self.driver.save(&scan.to_le_bytes());
            for tile in 0..10 {
                self.tiles.set([0, 0, tile], scan);
            }
            self.map.save_parts(&scan.to_le_bytes(), &mut self.tiles);
            Note { name: "robot".to_owned(), made_with: 0, run: RUN, start: 0, last_ns: scan }.write(&self.folder()).unwrap();
        }

        /// The scan of map, driver and note; none where they are not the same, or the map is not the one of that scan.
        fn restored(&self) -> Option<u64> {
            let (head, parts, _) = load(&checkpoint(&self.folder(), "mapping", RUN, 1))?;
            let (driver, ..) = load(&checkpoint(&self.folder(), "pioneer", RUN, 1))?;
            let scan = u64::from_le_bytes(head.clone().try_into().ok()?);
            let note = Note::read(&self.folder()).ok()??.last_ns;
            let tiles = parts.len() == 10 && parts.values().all(|part| part.starts_with(&head));
            (head == driver && note >= scan && tiles).then_some(scan)
        }
    }

    /// What a power cut may leave of a file that was not synced.
    #[derive(Debug, Clone, Copy)]
    enum Loss {
        Missing,
        Empty,
        /// The last part of so many is missing.
        Cut(usize),
        /// The last part of so many is zeros.
        Zeros(usize),
        Nothing,
    }

    fn losses() -> impl Strategy<Value = Loss> {
        prop_oneof![
            Just(Loss::Missing),
            Just(Loss::Empty),
            (1..9usize).prop_map(Loss::Cut),
            (1..9usize).prop_map(Loss::Zeros),
            Just(Loss::Nothing)
        ]
    }

    fn lose(path: &Path, loss: Loss) {
        let Ok(bytes) = std::fs::read(path) else { return };
        let from = |parts: usize| bytes.len() - bytes.len().div_ceil(parts);
        // Not in place: what is linked is another file.
        std::fs::remove_file(path).unwrap();
        let left = match loss {
            Loss::Missing => return,
            Loss::Empty => Vec::new(),
            Loss::Cut(parts) => bytes[..from(parts)].to_vec(),
            Loss::Zeros(parts) => bytes[..from(parts)].iter().copied().chain(std::iter::repeat(0)).take(bytes.len()).collect(),
            Loss::Nothing => bytes,
        };
        std::fs::write(path, left).unwrap();
    }

    proptest! {
        #[test]
        fn the_last_synced_set_survives_any_loss_of_the_rest(
            rounds in 1..6u64,
            more in 0..3u64,
            live in proptest::collection::vec(losses(), 3),
            unsynced in proptest::option::of(proptest::collection::vec(losses(), 4)),
        ) {
            let mut run = Run::new();
            let mut sets = run.sets();
            for round in 1..=rounds {
                run.save(10 * round);
                sets = sets.write().unwrap();
                run.save(10 * round + 1);
            }
            let synced = 10 * rounds;
            (2..2 + more).for_each(|scan| run.save(synced + scan));
            if let Some(unsynced) = &unsynced {
                // The power fails while this set is synced.
                sets.write().unwrap();
                let set = run.folder().join(FOLDERS[usize::from(rounds % 2 == 1)]);
                let files = [LIST, "mapping.checkpoint", "pioneer.checkpoint"];
                files.iter().zip(unsynced).for_each(|(file, loss)| lose(&set.join(file), *loss));
            }
            let before = run.restored();
            let files = ["mapping.checkpoint", "pioneer.checkpoint", NOTE];
            files.iter().zip(&live).for_each(|(file, loss)| lose(&run.folder().join(file), *loss));
            for _ in 0..2 {
                // Twice, since the power may fail again.
                prop_assert!(restore(&run.folder()).unwrap());
                let restored = run.restored();
                prop_assert!(restored == Some(synced) || unsynced.is_some() && restored == before, "{restored:?} {before:?}");
            }
        }
    }

    #[test]
    fn the_later_note_of_the_same_run_counts() {
        let note = |run, start, last_ns| Note { name: "robot".to_owned(), made_with: 0, run, start, last_ns };
        let of_the_set = note(RUN, 2, 50);
        for (live, expected) in [
            (None, note(RUN, 2, 50)),
            (Some(note(RUN, 3, 60)), note(RUN, 3, 60)),
            (Some(note(RUN, 1, 40)), note(RUN, 2, 50)),
            (Some(note(RUN + 1, 3, 60)), note(RUN, 2, 50)),
        ] {
            assert_eq!(later(of_the_set.clone(), live), expected);
        }
    }

    #[test]
    fn an_older_file_in_a_newer_set_makes_it_invalid() {
        let mut run = Run::new();
        run.save(3);
        run.sets().write().unwrap();
        let older = std::fs::read(run.folder().join(FOLDERS[0]).join("pioneer.checkpoint")).unwrap();
        run.save(4);
        run.sets().write().unwrap();
        assert_eq!(newest(&run.folder()).unwrap().unwrap().list.number, 1);
        std::fs::write(run.folder().join(FOLDERS[1]).join("pioneer.checkpoint"), older).unwrap();
        assert!(restore(&run.folder()).unwrap());
        assert_eq!(run.restored(), Some(3));
    }

    #[test]
    fn the_next_set_replaces_the_one_that_is_not_the_newest() {
        let mut run = Run::new();
        let mut sets = run.sets();
        for scan in 1..=5 {
            run.save(scan);
            // The second attempt is as good as the first, whose sync has failed.
            sets.write().unwrap();
            sets = sets.write().unwrap();
            assert_eq!(run.sets(), sets, "a new supervisor continues with the same one");
            assert!(restore(&run.folder()).unwrap());
            assert_eq!(run.restored(), Some(scan));
        }
        std::fs::remove_file(run.folder().join(FOLDERS[0]).join(LIST)).unwrap();
        assert_eq!((run.sets().next, newest(&run.folder()).unwrap().unwrap().list.number), (4, 3));
    }

    #[test]
    fn a_file_system_without_links_is_copied() {
        let mut run = Run::new();
        run.save(3);
        let refuse = |_: &Path, _: &Path| Err(io::Error::from(io::ErrorKind::PermissionDenied));
        run.sets().write_with(refuse).unwrap();
        run.save(4);
        assert!(restore(&run.folder()).unwrap());
        assert_eq!(run.restored(), Some(3));
    }

    #[test]
    fn nothing_is_added_while_a_checkpoint_is_elsewhere() {
        let mut run = Run::new();
        run.save(3);
        let sets = run.sets().write().unwrap();
        run.save(4);
        let fallback = run.out.path().join("fallback");
        std::fs::create_dir(&fallback).unwrap();
        std::fs::write(fallback.join("pioneer.checkpoint"), b"").unwrap();
        let error = sets.write().unwrap_err().to_string();
        assert!(error.ends_with("pioneer.checkpoint could not be written, and is old"), "{error}");
        assert!(restore(&run.folder()).unwrap());
        assert_eq!(run.restored(), Some(3));
    }

    #[test]
    fn sources_are_added_after_their_consumers() {
        let run = Run::new();
        std::fs::create_dir(run.folder()).unwrap();
        ["a", "pioneer", "std", "run"]
            .iter()
            .for_each(|name| std::fs::write(run.folder().join(format!("{name}.checkpoint")), b"").unwrap());
        let order = run.sets().in_order().unwrap();
        assert_eq!(order.last().unwrap(), "pioneer.checkpoint");
        assert_eq!(order.len(), 4);
    }

    #[test]
    fn a_checkpoint_newer_than_the_set_is_removed() {
        let mut run = Run::new();
        run.save(3);
        run.sets().write().unwrap();
        checkpoint(&run.folder(), "std", RUN, 0).save(b"later");
        assert!(restore(&run.folder()).unwrap());
        assert_eq!((run.restored(), run.folder().join("std.checkpoint").exists()), (Some(3), false));
        assert!(!restore(run.out.path()).unwrap(), "no set is there");
    }

    #[test]
    fn a_list_is_read_as_it_was_written_or_not_at_all() {
        let note = Note { name: "robot".to_owned(), made_with: 1, run: RUN, start: 2, last_ns: 3 };
        let listed = |name: &str, length, checksum| Listed { name: name.to_owned(), length, checksum };
        for files in [vec![], vec![listed("mapping.checkpoint", 5, 0), listed("two words", 6, u32::MAX)]] {
            let list = List { number: 9, files, note: note.clone() };
            let text = list.to_text();
            assert_eq!(List::parse(&text).as_ref(), Some(&list));
            assert!((0..text.len()).all(|end| List::parse(&text[..end]).is_none()));
        }
        let elsewhere = List { number: 9, files: vec![listed("../mapping.checkpoint", 5, 0)], note };
        assert_eq!(List::parse(&elsewhere.to_text()), None);
    }
}
