//! The log of a run, part after part.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::thread::JoinHandle;

use drivelog::{Log, Preamble, WriteError};
use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

use crate::buffer::LogBuffer;
use crate::file::LogFile;
use crate::limits::{Limits, remove};
use crate::written::{Change, WrittenPart};

/// What the recorder of a run has written, for the recorder that continues after it.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize, Schema)]
pub struct Written {
    /// The parts, in the order of their numbers.
    pub parts: Vec<WrittenPart>,
    /// Number of messages that are in none of them.
    pub not_recorded: u64,
    /// Parts up to this number may have been removed by the limits.
    pub removed: u32,
}

/// The log of a run on its way to the disk.
pub struct RunLog {
    preamble: Preamble,
    /// Path of the first part.
    first_path: PathBuf,
    buffer: LogBuffer,
    file: LogFile,
    /// The parts before this one.
    earlier: Vec<WrittenPart>,
    /// The end of a file that is not there any more has been written.
    is_left: bool,
    /// Parts that were found to be missing or cut.
    changed: Vec<(PathBuf, Change)>,
    /// The reason that the last write failed, as it was logged.
    write_error: Option<String>,
    has_ended: bool,
    limits: Limits,
    /// Parts up to this number may have been removed by the limits.
    removed: u32,
}

impl RunLog {
    /// The next part of the log of the preamble's run at this path, or its first part.
    ///
    /// # Errors
    /// When the file cannot be created, or the preamble is too large for the format.
    pub fn open(path: &Path, preamble: Preamble, limits: Limits, written: Written) -> io::Result<Self> {
        let last = written.parts.last().map_or(0, |part| part.number);
        let file = LogFile::of_run(path, preamble.run, last)?;
        let removed = written.removed.max(removed_before(path, preamble.run));
        let buffer = LogBuffer::resumed(&preamble, file.written().number, removed, written.not_recorded).map_err(io::Error::other)?;
        Ok(Self {
            preamble,
            first_path: path.to_owned(),
            buffer,
            file,
            earlier: written.parts,
            is_left: false,
            changed: Vec::new(),
            write_error: None,
            has_ended: false,
            limits,
            removed,
        })
    }

    /// The messages of the current part.
    pub fn buffer(&mut self) -> &mut LogBuffer {
        &mut self.buffer
    }

    /// What has been written, should this recorder end now.
    #[must_use]
    pub fn written(&self) -> Written {
        let parts = self.earlier.iter().copied().chain([self.file.written()]).collect();
        let waiting = if self.is_blocked() { self.buffer.unwritten() } else { 0 };
        Written { parts, not_recorded: self.buffer.dropped() + waiting, removed: self.removed }
    }

    /// Path of the current part.
    #[must_use]
    pub fn path(&self) -> &Path {
        self.file.path()
    }

    /// Whether writing fails.
    #[must_use]
    pub fn is_blocked(&self) -> bool {
        self.buffer.is_blocked()
    }

    /// Number of messages recorded.
    #[must_use]
    pub fn recorded(&self) -> u64 {
        self.buffer.recorded()
    }

    /// Number of messages that are lost for the log. Those that wait while writing fails are lost when it has ended.
    #[must_use]
    pub fn not_recorded(&self) -> u64 {
        if self.has_ended { self.written().not_recorded } else { self.buffer.dropped() }
    }

    /// Number of parts that were removed, moved or truncated.
    #[must_use]
    pub fn parts_missing(&self) -> u64 {
        self.changed.len() as u64
    }

    /// Bytes of the parts that this recorder and the ones before it have written and not removed.
    #[must_use]
    pub fn bytes(&self) -> u64 {
        self.written().parts.iter().map(|part| part.bytes).sum()
    }

    /// The reason that writing fails, if it does.
    #[must_use]
    pub fn write_error(&self) -> Option<&str> {
        self.write_error.as_deref()
    }

    /// Writes the closed chunks, so that they do not wait in memory for the next flush.
    ///
    /// # Errors
    /// When a chunk is too large for the format.
    pub fn write_chunks(&mut self) -> Result<(), WriteError> {
        if self.buffer.is_blocked() || self.buffer.chunks().is_empty() { Ok(()) } else { self.write(|buffer| Ok(buffer.chunks())) }
    }

    /// Writes what was recorded. The log continues in a new part when this one is full or its file was lost or fails.
    ///
    /// # Errors
    /// When a chunk is too large for the format.
    pub fn flush(&mut self) -> Result<(), WriteError> {
        self.write(LogBuffer::flush)
    }

    fn write(&mut self, bytes: impl FnOnce(&mut LogBuffer) -> Result<&[u8], WriteError>) -> Result<(), WriteError> {
        let change = self.file.change();
        let ends = || self.limits.ends_part(self.file.bytes(), &self.first_path, self.file.written().number);
        if change.is_some() || self.buffer.is_blocked() || self.buffer.is_full() || ends() {
            return self.continue_in_next_part(change, None);
        }
        match self.file.append(bytes(&mut self.buffer)?) {
            Ok(()) => self.buffer.written(),
            Err(error) if waits_for_space(&error) => self.fail(&error),
            Err(error) => {
                self.buffer.write_failed();
                self.continue_in_next_part(None, Some(error))?;
            }
        }
        Ok(())
    }

    /// Ends the part and begins the next one with what could not be written.
    fn continue_in_next_part(&mut self, change: Option<Change>, mut error: Option<io::Error>) -> Result<(), WriteError> {
        let was_blocked = self.buffer.is_blocked() && error.is_none();
        let end = self.buffer.end_part()?;
        if change.is_some() {
            // A file that was moved is complete then. The messages are in the next part, too.
            if !self.is_left && change == Some(Change::Moved) {
                let _ = self.file.append(end);
            }
            self.is_left = true;
        } else if error.is_none() {
            match self.file.append(end) {
                Ok(()) => self.buffer.written(),
                Err(full) if waits_for_space(&full) => {
                    self.fail(&full);
                    return Ok(());
                }
                Err(other) => error = Some(other),
            }
        }
        let number = self.file.written().number;
        let excess = self.limits.excess(&self.first_path, number.saturating_add(1));
        let removed = excess.last().map_or(self.removed, |part| part.number.max(self.removed));
        match self.begin_next_part(removed) {
            Ok((file, buffer)) => {
                let (old, new) = (self.file.path().display(), file.path().display());
                match (change, error) {
                    (Some(change), _) => tracing::warn!("{old} {change} while it was recorded; recording continues in {new}"),
                    (None, Some(error)) => tracing::warn!("{old} cannot be written: {error}; recording continues in {new}"),
                    (None, None) if was_blocked => {
                        tracing::info!("recording resumed in {new}; {} messages were not recorded", buffer.dropped());
                    }
                    (None, None) => tracing::info!("recording continues in {new}"),
                }
                self.changed.extend(change.map(|change| (self.file.path().to_owned(), change)));
                self.earlier.push(self.file.written());
                // The description of the next part names them, so that a reader does not miss them.
                remove(&excess);
                self.removed = removed;
                self.earlier.retain(|part| excess.iter().all(|old| old.number != part.number));
                (self.file, self.buffer) = (file, buffer);
                (self.is_left, self.write_error) = (false, None);
            }
            Err(error) => self.fail(&error),
        }
        Ok(())
    }

    fn begin_next_part(&self, removed: u32) -> io::Result<(LogFile, LogBuffer)> {
        let mut file = LogFile::after(&self.first_path, self.file.written().number)?;
        let mut buffer = self.buffer.next(&self.preamble, file.written().number, removed).map_err(io::Error::other)?;
        match file.append(buffer.flush().map_err(io::Error::other)?) {
            Ok(()) => {
                buffer.written();
                Ok((file, buffer))
            }
            // A part without its preamble would look like a damaged log.
            Err(error) => fs::remove_file(file.path()).and(Err(error)),
        }
    }

    fn fail(&mut self, error: &io::Error) {
        self.buffer.write_failed();
        let what = match error.kind() {
            io::ErrorKind::StorageFull | io::ErrorKind::QuotaExceeded => "the disk is full",
            io::ErrorKind::FileTooLarge => "the log file has reached its size limit",
            _ => "the log cannot be written",
        };
        let cause = format!("{what}: {}: {error}", self.file.path().display());
        if self.write_error.as_ref() != Some(&cause) {
            tracing::error!("{cause}; messages are not recorded until a write succeeds");
            self.write_error = Some(cause);
        }
    }

    /// Ends the log with its index, and has the disk take all parts: the thread returns the first error. On a full disk the index is
    /// lost; the log can be read without it.
    ///
    /// # Errors
    /// When a chunk is too large for the format.
    pub fn finish(&mut self) -> Result<JoinHandle<io::Result<()>>, WriteError> {
        self.flush()?;
        match self.file.append(self.buffer.finish()?) {
            Ok(()) => self.buffer.written(),
            Err(error) => self.fail(&error),
        }
        self.has_ended = true;
        let parts = self.written().parts;
        let paths: Vec<PathBuf> = parts.iter().map(|part| part.path(&self.first_path)).filter(|path| path.exists()).collect();
        // A slow disk takes longer than a process may be silent.
        Ok(std::thread::spawn(move || paths.iter().try_for_each(|path| fs::File::open(path)?.sync_all())))
    }

    /// Compares all parts with what was written, and reports what the log lacks. `synced` is the result of [`finish`](Self::finish).
    pub fn check(&mut self, synced: io::Result<()>) {
        let parts = self.written().parts;
        let changes = parts.iter().filter_map(|part| {
            let path = part.path(&self.first_path);
            let change = part.change(&path)?;
            let seen = self.changed.iter().find(|(changed, _)| *changed == path);
            Some(seen.cloned().unwrap_or((path, change)))
        });
        self.changed = changes.collect();
        let lost: u64 = parts.iter().map(|part| lost_bytes(part, &self.first_path)).sum();
        let (bytes, path) = (self.bytes() - lost, self.file.path().display());
        match parts.len() {
            1 => tracing::info!("recorded {bytes} bytes in {path}"),
            count => tracing::info!("recorded {bytes} bytes in {count} parts, the last of them {path}"),
        }
        let changes = self.changed.iter().map(|(path, change)| format!("{} {change}", path.display()));
        let dropped = Some(self.not_recorded()).filter(|count| *count > 0).map(|count| format!("{count} messages were not recorded"));
        let unsafe_on_disk = synced.err().map(|error| format!("the disk may have lost some of it: {error}"));
        let problems: Vec<String> = changes.chain(dropped).chain(unsafe_on_disk).collect();
        if !problems.is_empty() {
            tracing::error!("the log is incomplete: {}", problems.join(", "));
        }
    }
}

/// Parts up to this number may have been removed by the limits of an earlier recorder of this run, as its last part says.
fn removed_before(path: &Path, run: u64) -> u32 {
    // The file of the new part, which is empty, says nothing.
    let log = Log::open(path).ok().filter(|log| log.preamble().run == run);
    log.map_or(0, |log| log.removed_parts())
}

/// Bytes of a part that are not there any more.
fn lost_bytes(part: &WrittenPart, first: &Path) -> u64 {
    match part.change(&part.path(first)) {
        Some(Change::Truncated { bytes }) => part.bytes - bytes,
        Some(Change::Removed | Change::Moved) => part.bytes,
        None => 0,
    }
}

/// Whether a write may succeed later without a change of the file.
fn waits_for_space(error: &io::Error) -> bool {
    matches!(error.kind(), io::ErrorKind::StorageFull | io::ErrorKind::QuotaExceeded | io::ErrorKind::ReadOnlyFilesystem)
}

#[cfg(test)]
mod tests {
    use super::*;
    use drivelog::{Entry, Log, following_parts, info};
    use messages::{Pose, SonarScan};

    fn preamble() -> Preamble {
        Preamble { run: 1, robot: "pioneer-1".into(), sonars: Vec::new(), origin: "a test".into(), settings: String::new() }
    }

    fn record(log: &mut RunLog, seqs: std::ops::RangeInclusive<u64>) {
        for seq in seqs {
            let scan = SonarScan::new(Pose { x_m: seq as f64, ..Pose::default() }, &[], false);
            log.buffer().record(|recording| recording.scan(seq, seq, &scan)).unwrap();
        }
    }

    fn scans(path: &Path) -> Vec<u64> {
        let mut log = Log::open(path).unwrap();
        let mut scans = Vec::new();
        while let Ok(Some(entry)) = log.next_of::<SonarScan>() {
            if let Entry::Message { seq, .. } = entry {
                scans.push(seq);
            }
        }
        scans
    }

    fn end(log: &mut RunLog) {
        let synced = log.finish().unwrap().join().unwrap();
        log.check(synced);
    }

    /// A log whose file is changed between two flushes.
    struct Changed {
        folder: tempfile::TempDir,
        log: RunLog,
    }

    impl Changed {
        /// Scans 1 and 2 are written before the change, 3 after it.
        fn by(change: impl FnOnce(&Path)) -> Self {
            let folder = tempfile::tempdir().unwrap();
            let path = folder.path().join("out/drive.mcap");
            let mut log = RunLog::open(&path, preamble(), Limits::default(), Written::default()).unwrap();
            record(&mut log, 1..=2);
            log.flush().unwrap();
            record(&mut log, 3..=3);
            change(&path);
            log.flush().unwrap();
            record(&mut log, 4..=4);
            end(&mut log);
            Self { folder, log }
        }

        fn first(&self) -> PathBuf {
            self.folder.path().join("out/drive.mcap")
        }

        #[track_caller]
        fn assert_next_part_lacks(&self, change: Change, bytes_left: u64) {
            assert_eq!(self.log.changed, [(self.first(), change)]);
            assert_eq!(self.log.not_recorded(), 0);
            let gaps = info(&self.first()).unwrap().gaps;
            let part_2 = self.folder.path().join("out/drive.2.mcap");
            assert_eq!(scans(&part_2), [3, 4]);
            assert_eq!(self.log.bytes() - lost_bytes(&self.log.earlier[0], &self.first()), bytes_left + part_2.metadata().unwrap().len());
            assert_eq!(gaps.lines().last().unwrap(), "robot/scan: 2 messages: 1 to 2");
        }
    }

    #[test]
    fn a_log_without_a_change_is_one_complete_part() {
        let unchanged = Changed::by(|_| ());
        assert_eq!(scans(&unchanged.first()), [1, 2, 3, 4]);
        assert!(info(&unchanged.first()).unwrap().is_complete());
        assert_eq!((unchanged.log.parts_missing(), unchanged.log.not_recorded()), (0, 0));
    }

    #[test]
    fn a_removed_file_is_continued_by_the_next_part() {
        Changed::by(|path| fs::remove_file(path).unwrap()).assert_next_part_lacks(Change::Removed, 0);
        Changed::by(|path| fs::remove_dir_all(path.parent().unwrap()).unwrap()).assert_next_part_lacks(Change::Removed, 0);
    }

    #[test]
    fn a_truncated_file_is_continued_by_the_next_part() {
        let truncate = |path: &Path| fs::File::options().write(true).open(path).unwrap().set_len(0).unwrap();
        Changed::by(truncate).assert_next_part_lacks(Change::Truncated { bytes: 0 }, 0);
    }

    #[test]
    fn a_moved_file_is_ended_and_continued_by_the_next_part() {
        let moved = Changed::by(|path| fs::rename(path, path.with_file_name("moved.mcap")).unwrap());
        moved.assert_next_part_lacks(Change::Moved, 0);
        // It continues in a part that is not beside it.
        let elsewhere = info(&moved.folder.path().join("out/moved.mcap")).unwrap();
        assert_eq!((elsewhere.damage_count, elsewhere.gaps.lines()), (0, vec!["part 2 of the log".to_owned()]));
        assert_eq!(scans(&moved.folder.path().join("out/moved.mcap")), [1, 2, 3]);
        fs::rename(moved.folder.path().join("out/moved.mcap"), moved.first()).unwrap();
        assert_eq!(scans(&moved.first()), [1, 2, 3, 4]);
        assert!(info(&moved.first()).unwrap().is_complete());
    }

    #[test]
    fn a_file_whose_writes_fail_is_continued_by_the_next_part() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("drive.mcap");
        let mut log = RunLog::open(&path, preamble(), Limits::default(), Written::default()).unwrap();
        record(&mut log, 1..=2);
        log.flush().unwrap();
        log.file = log.file.on_a_failing_disk();
        record(&mut log, 3..=3);
        log.flush().unwrap();
        record(&mut log, 4..=4);
        end(&mut log);
        assert_eq!((scans(&path), scans(&folder.path().join("drive.2.mcap"))), (vec![1, 2, 3, 4], vec![3, 4]));
        assert_eq!((log.not_recorded(), log.parts_missing(), log.write_error()), (0, 0, None));
        assert_eq!(info(&path).unwrap().gaps.lines(), [""; 0]);
    }

    #[test]
    fn an_earlier_part_that_is_removed_is_missed_at_the_end() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("drive.mcap");
        let mut killed = RunLog::open(&path, preamble(), Limits::default(), Written::default()).unwrap();
        record(&mut killed, 1..=2);
        killed.flush().unwrap();
        let mut log = RunLog::open(&path, preamble(), Limits::default(), killed.written()).unwrap();
        record(&mut log, 3..=4);
        log.flush().unwrap();
        fs::remove_file(&path).unwrap();
        end(&mut log);
        assert_eq!(log.changed, [(path, Change::Removed)]);
    }

    #[test]
    fn messages_that_wait_for_a_folder_are_written_later() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("out/drive.mcap");
        let mut log = RunLog::open(&path, preamble(), Limits::default(), Written::default()).unwrap();
        log.flush().unwrap();
        record(&mut log, 1..=2);
        // A file where the folder was.
        fs::remove_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path.parent().unwrap(), "").unwrap();
        log.flush().unwrap();
        assert!(log.write_error().is_some() && log.is_blocked());
        record(&mut log, 3..=5);
        assert_eq!((log.not_recorded(), log.written().not_recorded), (3, 5), "a killed recorder loses what waits");
        fs::remove_file(path.parent().unwrap()).unwrap();
        log.flush().unwrap();
        record(&mut log, 6..=6);
        end(&mut log);
        assert_eq!(log.not_recorded(), 3);
        let gaps = info(&path).unwrap().gaps.lines();
        assert_eq!(gaps, ["part 1 of the log", "robot/scan: 3 messages: 3 to 5"]);
    }
    /// Records scans until there are so many parts, of about 64 scans each.
    fn record_parts(log: &mut RunLog, seq: &mut u64, last_part: u32) {
        while log.file.written().number < last_part {
            record(log, *seq..=*seq);
            *seq += 1;
            log.flush().unwrap();
        }
    }

    #[test]
    fn a_log_within_its_limits_is_complete_without_its_old_parts() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("drive.mcap");
        // A part ends at 8 kB; 56 kB of those before it stay.
        let limits = Limits { log_bytes: Some(64 << 10), free_bytes: None };
        let mut log = RunLog::open(&path, preamble(), limits, Written::default()).unwrap();
        let mut seq = 1;
        record_parts(&mut log, &mut seq, 3);
        fs::write(folder.path().join("drive.2.mcap.keep"), "").unwrap();
        record_parts(&mut log, &mut seq, 20);
        // A recorder that continues, after a kill and after a stop of the deployment.
        for (written, last_part) in [(log.written(), 22), (Written::default(), 24)] {
            log = RunLog::open(&path, preamble(), limits, written).unwrap();
            record_parts(&mut log, &mut seq, last_part);
        }
        end(&mut log);
        assert_eq!((log.parts_missing(), log.not_recorded()), (0, 0));
        let numbers: Vec<u32> = following_parts(&path).unwrap().iter().map(|(number, _)| *number).collect();
        assert!(!path.exists() && numbers[0] == 2 && numbers[1] > 10 && numbers.len() > 5, "{numbers:?}");
        let bytes: u64 = following_parts(&path).unwrap().iter().map(|(_, part)| part.metadata().unwrap().len()).sum();
        assert!(bytes < (64 << 10) + (16 << 10), "the marked part does not count: {bytes} bytes");
        // The parts of the recorders that were killed have no index; nothing is missing.
        let found = info(&path).unwrap();
        assert!(found.gaps.is_empty() && found.damage_count == 0, "{found}");
        assert_eq!(scans(&path).last(), Some(&(seq - 1)));
        // A part that nothing has removed on purpose is missed.
        fs::remove_file(drivelog::part_path(&path, *numbers.last().unwrap() - 1)).unwrap();
        assert_eq!(info(&path).unwrap().gaps.missing_parts(), 1);
    }
}
