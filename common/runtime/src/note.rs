//! The note beside the checkpoints of a run: whose they are.
//!
//! Its last two lines are times with a checksum, of which the later one counts and the other one is overwritten next: a new file every second
//! would be written to the disk each time.

use std::fs::File;
use std::io;
use std::os::unix::fs::FileExt;
use std::path::Path;

/// The file of the note.
pub(crate) const NOTE: &str = "run";
/// What a note begins with.
const MAGIC: &str = "stillmap run 2";

/// Bytes of a line with a time: 20 digits, a space, 8 digits, the end of the line.
const TIME: u64 = 30;

/// Whose the checkpoints in a folder are.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Note {
    /// Name of the deployment.
    pub(crate) name: String,
    /// Checksum of what they depend on.
    pub(crate) made_with: u32,
    pub(crate) run: u64,
    /// How many times the run was started before.
    pub(crate) start: u32,
    /// How late it was, on the deployment's clock, ns.
    pub(crate) last_ns: u64,
}

impl Note {
    /// The note in a folder of checkpoints, if there is one.
    pub(crate) fn read(folder: &Path) -> io::Result<Option<Self>> {
        match std::fs::read_to_string(folder.join(NOTE)) {
            Ok(text) => Ok(Self::parse(&text)),
            Err(error) if [io::ErrorKind::NotFound, io::ErrorKind::InvalidData].contains(&error.kind()) => Ok(None),
            Err(error) => Err(error),
        }
    }

    /// Writes the note. After a kill at any moment, either the old or the new one is there.
    pub(crate) fn write(&self, folder: &Path) -> io::Result<()> {
        let fresh = folder.join("run.new");
        std::fs::write(&fresh, self.to_text())?;
        std::fs::rename(&fresh, folder.join(NOTE))
    }

    /// Writes the time into the note as it was written, in the line that this number selects. After a kill at any moment the time in the
    /// other line is there. A note that is missing or another one is written anew.
    pub(crate) fn write_time(&self, folder: &Path, number: u64) -> io::Result<()> {
        let length = self.to_text().len() as u64;
        match File::options().write(true).open(folder.join(NOTE)) {
            Ok(file) if file.metadata()?.len() == length => {
                file.write_all_at(time(self.last_ns).as_bytes(), length - TIME * (1 + number % 2))
            }
            _ => self.write(folder),
        }
    }

    pub(crate) fn to_text(&self) -> String {
        let Self { name, made_with, run, start, last_ns } = self;
        let last = time(*last_ns);
        format!("{MAGIC}\n{name}\n{made_with:08x}\n{run:016x}\n{start}\n{last}{last}")
    }

    pub(crate) fn parse(text: &str) -> Option<Self> {
        let mut lines = text.lines();
        if lines.next()? != MAGIC {
            return None;
        }
        let name = lines.next()?.to_owned();
        let made_with = u32::from_str_radix(lines.next()?, 16).ok()?;
        let run = u64::from_str_radix(lines.next()?, 16).ok()?;
        let start = lines.next()?.parse().ok()?;
        let times = [lines.next()?, lines.next()?];
        let last_ns = times.into_iter().filter_map(parse_time).max()?;
        lines.next().is_none().then_some(Self { name, made_with, run, start, last_ns })
    }
}

fn time(ns: u64) -> String {
    let digits = format!("{ns:020}");
    format!("{digits} {:08x}\n", crc32fast::hash(digits.as_bytes()))
}

fn parse_time(line: &str) -> Option<u64> {
    let (digits, checksum) = line.split_once(' ')?;
    (u32::from_str_radix(checksum, 16).ok()? == crc32fast::hash(digits.as_bytes())).then(|| digits.parse().ok())?
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_note_is_read_as_it_was_written_and_not_when_it_is_cut() {
        let note = Note { name: "robot".into(), made_with: 5, run: 0xfeed, start: 3, last_ns: 99 };
        let text = note.to_text();
        assert_eq!(Note::parse(&text), Some(note));
        assert!((0..text.len() - TIME as usize).all(|end| Note::parse(&text[..end]).is_none()));
        assert_eq!(Note::parse(&format!("{text}more\n")), None);
    }

    #[test]
    fn a_time_that_is_cut_off_anywhere_leaves_the_one_before() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(NOTE);
        let at = |last_ns| Note { name: "robot".into(), made_with: 5, run: 0xfeed, start: 3, last_ns };
        at(7).write_time(folder.path(), 0).unwrap();
        for number in 1..5 {
            let before = std::fs::read(&path).unwrap();
            at(7 + number).write_time(folder.path(), number).unwrap();
            let after = std::fs::read(&path).unwrap();
            assert_eq!(Note::read(folder.path()).unwrap(), Some(at(7 + number)));
            let changed: Vec<usize> = (0..after.len()).filter(|place| before[*place] != after[*place]).collect();
            for written in changed {
                let mut cut = after.clone();
                cut[written..].copy_from_slice(&before[written..]);
                std::fs::write(&path, cut).unwrap();
                assert_eq!(Note::read(folder.path()).unwrap(), Some(at(6 + number)));
            }
            std::fs::write(&path, after).unwrap();
        }
        std::fs::write(&path, "of another").unwrap();
        at(20).write_time(folder.path(), 1).unwrap();
        assert_eq!(Note::read(folder.path()).unwrap(), Some(at(20)));
    }
}
