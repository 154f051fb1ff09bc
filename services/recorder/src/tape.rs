//! A log in memory on its way to the disk, and what to do when the disk takes no more.

use drivelog::{Preamble, Recording, Scene, WriteError};

/// Chunks of a file, after which the log goes on in the next one. Until a file is finished its index is in memory, 690 bytes
/// for a chunk of twelve or more topics: 0.7 MB in all. With a flush every second a file lasts for 17 minutes.
const MOST_CHUNKS: u64 = 1024;

/// A log on its way to a file that may refuse it for a while.
///
/// What was recorded before the file refused is kept and offered again, to end that file; what comes until it takes it is
/// counted and left out, so that the memory does not grow. Then, and when it [is full](Self::is_full), the log goes on in a new
/// file with the [next](Self::next) tape.
pub struct Tape {
    /// None once it is finished.
    recording: Option<Recording>,
    /// How far it had come when it was finished.
    scene: Scene,
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
        Ok(Self::of(Recording::new(preamble)?))
    }

    fn of(recording: Recording) -> Self {
        Self { recording: Some(recording), scene: Scene::default(), ready: Vec::new(), blocked: false, recorded: 0, left_out: 0 }
    }

    /// The log that goes on after this one, which is finished. It begins with the map as this one ended with it, and goes on
    /// counting what was recorded and left out.
    ///
    /// # Errors
    /// As [`Tape::new`].
    pub fn next(&self, preamble: &Preamble) -> Result<Self, WriteError> {
        let recording = Recording::after(self.scene.clone(), preamble)?;
        Ok(Self { recorded: self.recorded, left_out: self.left_out, ..Self::of(recording) })
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

    /// The chunks that are closed, and that the file has not taken: they need not wait in memory for the next flush.
    pub fn chunks(&mut self) -> &[u8] {
        if let Some(recording) = self.recording.as_mut().filter(|_| !self.blocked) {
            self.ready.append(&mut recording.take());
        }
        &self.ready
    }

    /// Everything recorded that the file has not taken.
    ///
    /// # Errors
    /// When the log cannot be put together.
    pub fn flush(&mut self) -> Result<&[u8], WriteError> {
        if let Some(recording) = self.recording.as_mut().filter(|_| !self.blocked) {
            recording.flush()?;
        }
        Ok(self.chunks())
    }

    /// The file has taken what [`chunks`](Self::chunks) or [`flush`](Self::flush) gave.
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

    /// Whether the log is to go on in a new file.
    #[must_use]
    pub fn is_full(&self) -> bool {
        self.recording.as_ref().is_some_and(|recording| recording.chunks() >= MOST_CHUNKS)
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
            let (rest, scene) = recording.finish_part()?;
            self.ready.extend(rest);
            self.scene = scene;
        }
        Ok(&self.ready)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use drivelog::{Entry, Log};
    use messages::{CameraFrame, FrameLayout, PixelFormat, Pose, SonarScan};

    fn preamble() -> Preamble {
        Preamble { run: 1, robot: "pioneer-1".into(), sonars: Vec::new(), origin: "a test".into(), settings: String::new() }
    }

    fn tape() -> Tape {
        Tape::new(&preamble()).unwrap()
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

    #[test]
    fn a_full_tape_goes_on_in_a_next_one_and_each_is_a_log() {
        let mut tape = tape();
        let mut parts = vec![Vec::new()];
        for seq in 1..=2 * MOST_CHUNKS + 1 {
            record(&mut tape, seq);
            if tape.is_full() {
                parts.last_mut().unwrap().extend_from_slice(tape.finish().unwrap());
                tape = tape.next(&preamble()).unwrap();
                parts.push(Vec::new());
            }
            parts.last_mut().unwrap().extend_from_slice(tape.flush().unwrap());
            tape.taken();
        }
        parts.last_mut().unwrap().extend_from_slice(tape.finish().unwrap());
        assert_eq!((tape.recorded(), tape.left_out()), (2 * MOST_CHUNKS + 1, 0));
        let all: Vec<Vec<u64>> = parts.iter().map(|part| scans(part)).collect();
        assert_eq!(all.concat(), (1..=2 * MOST_CHUNKS + 1).collect::<Vec<_>>());
        assert_eq!(all.iter().map(Vec::len).collect::<Vec<_>>(), [MOST_CHUNKS as usize + 1, MOST_CHUNKS as usize]);
    }

    #[test]
    fn a_closed_chunk_does_not_wait_for_the_flush() {
        let layout = FrameLayout::packed(160, 120, PixelFormat::Grey);
        let (mut tape, mut disk, mut most) = (tape(), Vec::new(), 0);
        for seq in 1..=500_u64 {
            // Noise, which does not compress.
            let next = |last: &u64| Some(last.wrapping_mul(0x5851_f42d_4c95_7f2d).wrapping_add(0x1405_7b7e_f767_814f));
            let noise = std::iter::successors(Some(seq << 32), next).map(|state| (state >> 56) as u8);
            let bytes: Vec<u8> = noise.skip(1).take(layout.bytes()).collect();
            record(&mut tape, seq);
            tape.record(|recording| recording.picture::<CameraFrame>(seq, seq, &layout, &bytes)).unwrap();
            most = most.max(tape.chunks().len());
            disk.extend_from_slice(tape.chunks());
            tape.taken();
        }
        assert!(most > 0 && most < 2 << 20, "{most} bytes at once");
        assert!(disk.len() > 500 * layout.bytes() * 3 / 4, "{} bytes", disk.len());
        disk.extend_from_slice(tape.finish().unwrap());
        assert_eq!(scans(&disk), (1..=500).collect::<Vec<_>>());
    }
}
