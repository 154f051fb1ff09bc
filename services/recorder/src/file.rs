//! The file of one part of a log.

use std::fs::{self, File};
use std::io;
use std::os::unix::fs::{FileExt, MetadataExt};
use std::path::{Path, PathBuf};

use drivelog::{Log, following_parts, part_path};

use crate::written::{Change, WrittenPart};

/// A file to which pieces of a log are appended completely or not at all.
#[derive(Debug)]
pub struct LogFile {
    file: File,
    path: PathBuf,
    written: WrittenPart,
}

impl LogFile {
    /// The next part of the log of this run, or its first part if there is none. A log of another run at this path is renamed: a
    /// recorder that was killed while it started may not have created its own. Parts up to `last` have been created, whether or not their
    /// files are still there.
    ///
    /// # Errors
    /// When the folder or the file cannot be created.
    pub fn of_run(path: &Path, run: u64, last: u32) -> io::Result<Self> {
        if let Some(folder) = path.parent() {
            fs::create_dir_all(folder)?;
        }
        let is_of_run = |part: &Path| Log::open(part).is_ok_and(|log| log.preamble().run == run);
        let parts = following_parts(path)?;
        let begun = is_of_run(path) || parts.iter().any(|(_, part)| is_of_run(part));
        if begun {
            return Self::after(path, last);
        }
        rename_existing(path)?;
        if last > 0 { Self::after(path, last) } else { Self::create(path.to_owned(), 1) }
    }

    /// The part that follows part `last` and all files at this path.
    ///
    /// # Errors
    /// When the folder or the file cannot be created.
    pub fn after(path: &Path, last: u32) -> io::Result<Self> {
        if let Some(folder) = path.parent() {
            fs::create_dir_all(folder)?;
        }
        let present = following_parts(path)?.last().map_or(1, |(number, _)| *number);
        let number = last.max(present).saturating_add(1);
        Self::create(part_path(path, number), number)
    }

    fn create(path: PathBuf, number: u32) -> io::Result<Self> {
        let file = File::create_new(&path)?;
        let status = file.metadata()?;
        Ok(Self { file, path, written: WrittenPart { number, device: status.dev(), inode: status.ino(), bytes: 0 } })
    }

    /// Appends a piece, completely or not at all.
    ///
    /// # Errors
    /// When it cannot be written completely; the file is then truncated to its former size.
    pub fn append(&mut self, piece: &[u8]) -> io::Result<()> {
        match self.file.write_all_at(piece, self.written.bytes) {
            Ok(()) => {
                self.written.bytes += piece.len() as u64;
                Ok(())
            }
            Err(error) => {
                // If this fails too, the file ends in half a piece. A log is readable up to there, and the next write replaces it.
                let _ = self.file.set_len(self.written.bytes);
                Err(error)
            }
        }
    }

    /// What has happened to the file since it was last written; `None` if it is as it should be.
    #[must_use]
    pub fn change(&self) -> Option<Change> {
        let change = self.written.change(&self.path)?;
        let is_elsewhere = self.file.metadata().is_ok_and(|status| status.nlink() > 0);
        Some(if change == Change::Removed && is_elsewhere { Change::Moved } else { change })
    }

    /// Path of the file.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// What has been written.
    #[must_use]
    pub fn written(&self) -> WrittenPart {
        self.written
    }

    /// Size of the file in bytes.
    #[must_use]
    pub fn bytes(&self) -> u64 {
        self.written.bytes
    }
}

#[cfg(test)]
impl LogFile {
    /// The same file on a disk that fails: every write gives EIO, as one to an address does at which no memory is.
    pub(crate) fn on_a_failing_disk(self) -> Self {
        let file = File::options().write(true).open("/proc/self/mem").unwrap_or(self.file);
        Self { file, path: self.path, written: self.written }
    }
}

/// Renames a log with all its parts, if there is one: `drive.mcap` to `drive-<run>.mcap`.
fn rename_existing(path: &Path) -> io::Result<()> {
    let parts = following_parts(path)?;
    if !path.exists() && parts.is_empty() {
        return Ok(());
    }
    if parts.is_empty() && fs::metadata(path)?.len() == 0 {
        return fs::remove_file(path);
    }
    let name = match Log::open(path) {
        Ok(log) => format!("{:016x}", log.preamble().run),
        Err(_) => "unreadable".to_owned(),
    };
    let stem = path.file_stem().unwrap_or_default().to_string_lossy();
    let extension = path.extension().map(|extension| format!(".{}", extension.to_string_lossy())).unwrap_or_default();
    let names = std::iter::once(String::new()).chain((2_u32..).map(|number| format!("-{number}")));
    let mut candidates = names.map(|more| path.with_file_name(format!("{stem}-{name}{more}{extension}")));
    let is_free = |path: &PathBuf| !path.exists() && following_parts(path).is_ok_and(|parts| parts.is_empty());
    let new_path = candidates.find(is_free).ok_or_else(|| io::Error::other("every name for the log of an earlier run is taken"))?;
    if path.exists() {
        fs::rename(path, &new_path)?;
    }
    for (number, part) in parts {
        fs::rename(part, part_path(&new_path, number))?;
    }
    tracing::info!("the log of an earlier run is renamed to {}", new_path.display());
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn first(path: &Path) -> LogFile {
        LogFile::of_run(path, 1, 0).unwrap()
    }

    #[test]
    fn a_failed_append_leaves_the_file_unchanged() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("out/drive.mcap");
        let mut file = first(&path);
        file.append(b"one ").unwrap();
        file.append(b"two").unwrap();
        assert_eq!((fs::read(&path).unwrap().as_slice(), file.bytes()), (b"one two".as_slice(), 7));

        // A device without space.
        let full = File::options().write(true).open("/dev/full").unwrap();
        let mut full = LogFile { file: full, path: "/dev/full".into(), written: WrittenPart { bytes: 0, ..file.written() } };
        assert_eq!(full.append(b"three").unwrap_err().kind(), io::ErrorKind::StorageFull);
        assert_eq!(full.bytes(), 0);
    }

    #[test]
    fn parts_are_numbered_and_a_new_run_renames_them() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("drive.mcap");
        for (number, expected) in (0..).zip(["drive.mcap", "drive.2.mcap", "drive.3.mcap"]) {
            let mut file = if number == 0 { first(&path) } else { LogFile::after(&path, 1).unwrap() };
            assert_eq!(file.path().file_name().unwrap(), expected);
            assert_eq!(file.written().number, number + 1);
            file.append(expected.as_bytes()).unwrap();
        }
        first(&path);
        let mut names: Vec<_> = folder.path().read_dir().unwrap().map(|entry| entry.unwrap().file_name()).collect();
        names.sort();
        assert_eq!(names, ["drive-unreadable.2.mcap", "drive-unreadable.3.mcap", "drive-unreadable.mcap", "drive.mcap"]);
        assert_eq!(fs::read(folder.path().join("drive-unreadable.3.mcap")).unwrap(), b"drive.3.mcap");
    }

    #[test]
    fn the_number_of_a_removed_part_is_not_used_again() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("out/drive.mcap");
        let removed = first(&path);
        fs::remove_dir_all(path.parent().unwrap()).unwrap();
        let next = LogFile::after(&path, removed.written().number).unwrap();
        assert_eq!(next.path(), part_path(&path, 2));
        drop(next);
        fs::remove_dir_all(path.parent().unwrap()).unwrap();
        assert_eq!(LogFile::of_run(&path, 1, 2).unwrap().path(), part_path(&path, 3), "a recorder that was restarted");
    }

    #[test]
    fn a_run_continues_its_own_log_and_overwrites_nothing() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("drive.mcap");
        let begin = |run: u64| {
            let preamble =
                drivelog::Preamble { run, robot: "pioneer-1".into(), sonars: Vec::new(), origin: "a test".into(), settings: String::new() };
            let mut file = LogFile::of_run(&path, run, 0).unwrap();
            let mut recording = drivelog::Recording::new(&preamble).unwrap();
            recording.flush().unwrap();
            file.append(&recording.take()).unwrap();
            file.path().file_name().unwrap().to_str().unwrap().to_owned()
        };
        assert_eq!((begin(1), begin(1)), ("drive.mcap".to_owned(), "drive.2.mcap".to_owned()));
        // A recorder of another run, killed before it wrote anything, and the next recorder of that run.
        drop(LogFile::of_run(&path, 2, 0).unwrap());
        assert_eq!((begin(2), begin(2)), ("drive.mcap".to_owned(), "drive.2.mcap".to_owned()));
        for unreadable in [b"one", b"two"] {
            fs::remove_file(folder.path().join("drive.2.mcap")).ok();
            fs::write(&path, unreadable).unwrap();
            begin(3);
            fs::remove_file(&path).unwrap();
        }
        let content = |name: &str| fs::read(folder.path().join(name)).unwrap();
        assert_eq!((content("drive-unreadable.mcap"), content("drive-unreadable-2.mcap")), (b"one".to_vec(), b"two".to_vec()));
        assert!(folder.path().join("drive-0000000000000001.2.mcap").exists());
    }

    #[test]
    fn the_change_of_a_file_is_found() {
        let change = |harm: &dyn Fn(&Path)| {
            let folder = tempfile::tempdir().unwrap();
            let path = folder.path().join("drive.mcap");
            let mut file = first(&path);
            file.append(b"recorded").unwrap();
            harm(&path);
            file.change()
        };
        assert_eq!(change(&|_| ()), None);
        assert_eq!(change(&|path| fs::remove_file(path).unwrap()), Some(Change::Removed));
        assert_eq!(change(&|path| fs::remove_dir_all(path.parent().unwrap()).unwrap()), Some(Change::Removed));
        assert_eq!(change(&|path| fs::rename(path, path.with_extension("old")).unwrap()), Some(Change::Moved));
        let replaced = |path: &Path| {
            fs::remove_file(path).unwrap();
            fs::write(path, "something else").unwrap();
        };
        assert_eq!(change(&replaced), Some(Change::Removed));
        let truncated = |path: &Path| File::options().write(true).open(path).unwrap().set_len(3).unwrap();
        assert_eq!(change(&truncated), Some(Change::Truncated { bytes: 3 }));
    }
}
