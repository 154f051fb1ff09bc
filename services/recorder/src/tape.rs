//! A log in memory on its way to the disk, and what to do when the disk takes no more.

use drivelog::{Preamble, Recording, WriteError};

/// A log on its way to a file that may refuse it for a while.
///
/// What was recorded before the file refused is kept and offered again, to end that file; what comes until it takes it is
/// counted and left out, so that the memory does not grow. Then the log goes on in a new file with the [next](Self::next) tape.
pub struct Tape {
    /// None once it is finished.
    recording: Option<Recording>,
    /// Bytes that the file is to take next.
    ready: Vec<u8>,
    blocked: bool,
    recorded: u64,
    left_out: u64,
}

impl Tape {
    /// An empty log.
    ///
    /// # Errors
    /// When the preamble is too large for the format.
    pub fn new(preamble: &Preamble) -> Result<Self, WriteError> {
        Ok(Self { recording: Some(Recording::new(preamble)?), ready: Vec::new(), blocked: false, recorded: 0, left_out: 0 })
    }

    /// An empty log after this one, which goes on counting what was recorded and left out.
    ///
    /// # Errors
    /// As [`Tape::new`].
    pub fn next(&self, preamble: &Preamble) -> Result<Self, WriteError> {
        Ok(Self { recorded: self.recorded, left_out: self.left_out, ..Self::new(preamble)? })
    }

    /// Records what `put` adds, unless the file refuses.
    ///
    /// # Errors
    /// Those of `put`.
    pub fn record(&mut self, put: impl FnOnce(&mut Recording) -> Result<(), WriteError>) -> Result<(), WriteError> {
        match &mut self.recording {
            Some(recording) if !self.blocked => {
                self.recorded += 1;
                put(recording)
            }
            _ => {
                self.left_out += 1;
                Ok(())
            }
        }
    }

    /// Everything recorded that the file has not taken.
    ///
    /// # Errors
    /// When the log cannot be put together.
    pub fn flush(&mut self) -> Result<&[u8], WriteError> {
        if let Some(recording) = self.recording.as_mut().filter(|_| !self.blocked) {
            recording.flush()?;
            self.ready.extend(recording.take());
        }
        Ok(&self.ready)
    }

    /// The file has taken what [`flush`](Self::flush) gave.
    pub fn taken(&mut self) {
        self.ready.clear();
        self.blocked = false;
    }

    /// The file has refused it.
    pub fn refused(&mut self) {
        self.blocked = true;
    }

    /// Whether the file refuses.
    #[must_use]
    pub fn is_blocked(&self) -> bool {
        self.blocked
    }

    /// Messages recorded.
    #[must_use]
    pub fn recorded(&self) -> u64 {
        self.recorded
    }

    /// Messages left out because the file refused.
    #[must_use]
    pub fn left_out(&self) -> u64 {
        self.left_out
    }

    /// Everything that the file has not taken, with the index that ends the log.
    ///
    /// # Errors
    /// When the log cannot be put together.
    pub fn finish(&mut self) -> Result<&[u8], WriteError> {
        if let Some(recording) = self.recording.take() {
            self.ready.extend(recording.finish()?);
        }
        Ok(&self.ready)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use drivelog::{Entry, Log};
    use messages::{Pose, SonarScan};

    fn tape() -> Tape {
        let preamble = Preamble { run: 1, robot: "pioneer-1".into(), sonars: Vec::new(), origin: "a test".into(), settings: String::new() };
        Tape::new(&preamble).unwrap()
    }

    fn record(tape: &mut Tape, seq: u64) {
        let scan = SonarScan::new(Pose { x_m: seq as f64, ..Pose::default() }, &[], false);
        tape.record(|recording| recording.scan(seq, seq, &scan)).unwrap();
    }

    fn scans(bytes: &[u8]) -> Vec<u64> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("drive.mcap");
        std::fs::write(&path, bytes).unwrap();
        let mut log = Log::open(&path).unwrap();
        let mut scans = Vec::new();
        while let Some(entry) = log.next_of::<SonarScan>().unwrap() {
            if let Entry::Message { seq, .. } = entry {
                scans.push(seq);
            }
        }
        scans
    }

    #[test]
    fn what_was_recorded_before_the_disk_was_full_comes_into_the_log_when_it_is_not() {
        let mut tape = tape();
        let mut disk = Vec::new();
        record(&mut tape, 1);
        disk.extend_from_slice(tape.flush().unwrap());
        tape.taken();
        record(&mut tape, 2);
        let waiting = tape.flush().unwrap().len();
        tape.refused();
        for seq in 3..1_000 {
            record(&mut tape, seq);
            assert_eq!(tape.flush().unwrap().len(), waiting, "memory does not grow");
        }
        assert_eq!((tape.is_blocked(), tape.left_out(), tape.recorded()), (true, 997, 2));
        assert_eq!(scans(&disk), [1]);
        disk.extend_from_slice(tape.flush().unwrap());
        tape.taken();
        record(&mut tape, 1_000);
        disk.extend_from_slice(tape.finish().unwrap());
        assert_eq!(scans(&disk), [1, 2, 1_000]);
    }
}
