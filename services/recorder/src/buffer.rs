//! The part of a log that is recorded and not yet written.

use drivelog::{Preamble, Recording, Scene, WriteError};

/// Chunks of a part. The index of a part is in memory until the part is finished, 690 bytes for a chunk of twelve or more topics:
/// 0.7 MB in all. With a flush every second a part lasts 17 minutes.
const MOST_CHUNKS: u64 = 1024;

/// A log part on its way to a file whose writes may fail for a while.
///
/// After a failed write the buffer is blocked: it keeps what it holds, to end that file with it, and drops and counts every new
/// message, so that its memory does not grow. When the file has been ended, or when the part [is full](Self::is_full), the log
/// continues in a new file with the [next](Self::next) buffer, which begins with the messages that were not written.
pub struct LogBuffer {
    /// `None` once the part is finished.
    recording: Option<Recording>,
    /// State of the log at the end of the part, from which the next one begins.
    scene: Scene,
    /// Bytes to write next.
    pending: Vec<u8>,
    blocked: bool,
    recorded: u64,
    /// Recorded messages that are not in a file.
    unwritten: u64,
    /// Those of them whose chunk is not closed.
    open: u64,
    dropped: u64,
}

impl LogBuffer {
    /// An empty log that begins with this preamble.
    ///
    /// # Errors
    /// When the preamble is too large for the format.
    pub fn new(preamble: &Preamble) -> Result<Self, WriteError> {
        Ok(Self::of(Recording::new(preamble)?))
    }

    /// An empty log that begins as part `number`, after parts that lack so many messages. Parts up to `removed` may be gone on purpose.
    ///
    /// # Errors
    /// As [`LogBuffer::new`].
    pub fn resumed(preamble: &Preamble, number: u32, removed: u32, dropped: u64) -> Result<Self, WriteError> {
        Ok(Self { dropped, ..Self::of(Recording::after(Scene::default(), &[], number, removed, preamble)?) })
    }

    fn of(recording: Recording) -> Self {
        Self {
            recording: Some(recording),
            scene: Scene::default(),
            pending: Vec::new(),
            blocked: false,
            recorded: 0,
            unwritten: 0,
            open: 0,
            dropped: 0,
        }
    }

    /// The buffer of part `number`, after this one, which [has ended](Self::end_part). It begins with the messages of this one that
    /// are not written and with the map at its end, and its counts include those of this one. Parts up to `removed` may be gone on purpose.
    ///
    /// # Errors
    /// As [`LogBuffer::new`].
    pub fn next(&self, preamble: &Preamble, number: u32, removed: u32) -> Result<Self, WriteError> {
        let recording = Recording::after(self.scene.clone(), &self.pending, number, removed, preamble)?;
        let (recorded, unwritten, dropped) = (self.recorded, self.unwritten, self.dropped);
        Ok(Self { recorded, unwritten, open: unwritten, dropped, ..Self::of(recording) })
    }

    /// Records one message with `add`, or drops it while the buffer is blocked.
    ///
    /// # Errors
    /// Those of `add`.
    pub fn record(&mut self, add: impl FnOnce(&mut Recording) -> Result<(), WriteError>) -> Result<(), WriteError> {
        match &mut self.recording {
            Some(recording) if !self.blocked => {
                self.recorded += 1;
                self.unwritten += 1;
                let closed = recording.chunks();
                let added = add(recording);
                // A chunk is closed before the message for which it is too large.
                self.open = if recording.chunks() > closed { 1 } else { self.open + 1 };
                added
            }
            _ => {
                self.dropped += 1;
                Ok(())
            }
        }
    }

    /// The closed chunks that are not written: they need not wait in memory for the next flush.
    pub fn chunks(&mut self) -> &[u8] {
        if let Some(recording) = self.recording.as_mut().filter(|_| !self.blocked) {
            self.pending.append(&mut recording.take());
        }
        &self.pending
    }

    /// Everything recorded that is not written.
    ///
    /// # Errors
    /// When the chunk is too large for the format.
    pub fn flush(&mut self) -> Result<&[u8], WriteError> {
        if let Some(recording) = self.recording.as_mut().filter(|_| !self.blocked) {
            recording.flush()?;
            self.open = 0;
        }
        Ok(self.chunks())
    }

    /// Reports that what [`chunks`](Self::chunks), [`flush`](Self::flush), [`end_part`](Self::end_part) or [`finish`](Self::finish)
    /// returned is in the file.
    pub fn written(&mut self) {
        self.unwritten = self.open;
        self.pending.clear();
        self.blocked = false;
    }

    /// Reports that it could not be written.
    pub fn write_failed(&mut self) {
        self.blocked = true;
    }

    /// Whether the last write failed.
    #[must_use]
    pub fn is_blocked(&self) -> bool {
        self.blocked
    }

    /// Whether the log has to continue in a new file.
    #[must_use]
    pub fn is_full(&self) -> bool {
        self.recording.as_ref().is_some_and(|recording| recording.chunks() >= MOST_CHUNKS)
    }

    /// Number of messages recorded, over all parts.
    #[must_use]
    pub fn recorded(&self) -> u64 {
        self.recorded
    }

    /// Number of messages dropped while the buffer was blocked, over all parts.
    #[must_use]
    pub fn dropped(&self) -> u64 {
        self.dropped
    }

    /// Number of messages that are recorded and not yet in a file.
    #[must_use]
    pub fn unwritten(&self) -> u64 {
        self.unwritten
    }

    /// Everything that is not written, with the index that ends the part. Another part follows.
    ///
    /// # Errors
    /// When the chunk is too large for the format.
    pub fn end_part(&mut self) -> Result<&[u8], WriteError> {
        if let Some(recording) = self.recording.take() {
            let (rest, scene) = recording.finish_part()?;
            self.pending.extend(rest);
            self.scene = scene;
            self.open = 0;
        }
        Ok(&self.pending)
    }

    /// Everything that is not written, with the index that ends the log.
    ///
    /// # Errors
    /// When the chunk is too large for the format.
    pub fn finish(&mut self) -> Result<&[u8], WriteError> {
        if let Some(recording) = self.recording.take() {
            self.pending.extend(recording.finish()?);
            self.open = 0;
        }
        Ok(&self.pending)
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

    fn buffer() -> LogBuffer {
        LogBuffer::new(&preamble()).unwrap()
    }

    fn record(buffer: &mut LogBuffer, seq: u64) {
        let scan = SonarScan::new(Pose { x_m: seq as f64, ..Pose::default() }, &[], false);
        buffer.record(|recording| recording.scan(seq, seq, &scan)).unwrap();
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
    fn a_failed_write_is_repeated_and_later_messages_are_dropped() {
        let mut buffer = buffer();
        let mut disk = Vec::new();
        record(&mut buffer, 1);
        disk.extend_from_slice(buffer.flush().unwrap());
        buffer.written();
        record(&mut buffer, 2);
        let waiting = buffer.flush().unwrap().len();
        buffer.write_failed();
        for seq in 3..1_000 {
            record(&mut buffer, seq);
            assert_eq!(buffer.flush().unwrap().len(), waiting, "memory does not grow");
        }
        assert_eq!((buffer.is_blocked(), buffer.dropped(), buffer.recorded()), (true, 997, 2));
        assert_eq!(scans(&disk), [1]);
        disk.extend_from_slice(buffer.flush().unwrap());
        buffer.written();
        record(&mut buffer, 1_000);
        disk.extend_from_slice(buffer.finish().unwrap());
        assert_eq!(scans(&disk), [1, 2, 1_000]);
    }

    #[test]
    fn a_full_buffer_is_continued_by_the_next_part() {
        let mut buffer = buffer();
        let mut parts = vec![Vec::new()];
        for seq in 1..=2 * MOST_CHUNKS + 1 {
            record(&mut buffer, seq);
            if buffer.is_full() {
                parts.last_mut().unwrap().extend_from_slice(buffer.end_part().unwrap());
                buffer.written();
                buffer = buffer.next(&preamble(), 2, 0).unwrap();
                parts.push(Vec::new());
            }
            parts.last_mut().unwrap().extend_from_slice(buffer.flush().unwrap());
            buffer.written();
        }
        parts.last_mut().unwrap().extend_from_slice(buffer.finish().unwrap());
        assert_eq!((buffer.recorded(), buffer.dropped()), (2 * MOST_CHUNKS + 1, 0));
        let all: Vec<Vec<u64>> = parts.iter().map(|part| scans(part)).collect();
        assert_eq!(all.concat(), (1..=2 * MOST_CHUNKS + 1).collect::<Vec<_>>());
        assert_eq!(all.iter().map(Vec::len).collect::<Vec<_>>(), [MOST_CHUNKS as usize + 1, MOST_CHUNKS as usize]);
    }

    #[test]
    fn the_next_part_begins_with_what_was_not_written() {
        let mut buffer = buffer();
        record(&mut buffer, 1);
        let disk = buffer.flush().unwrap().to_vec();
        buffer.written();
        record(&mut buffer, 2);
        buffer.flush().unwrap();
        buffer.write_failed();
        record(&mut buffer, 3);
        buffer.end_part().unwrap();
        assert_eq!((buffer.unwritten(), buffer.dropped()), (1, 1));
        let mut next = buffer.next(&preamble(), 2, 0).unwrap();
        assert_eq!((next.recorded(), next.unwritten(), next.dropped()), (2, 1, 1));
        record(&mut next, 4);
        assert_eq!(scans(next.finish().unwrap()), [2, 4]);
        next.written();
        assert_eq!((next.recorded(), next.unwritten(), next.dropped()), (3, 0, 1));
        assert_eq!(scans(&disk), [1]);
    }

    #[test]
    fn messages_count_as_written_when_their_chunk_is() {
        let layout = FrameLayout::packed(640, 480, PixelFormat::Rgb);
        let mut buffer = buffer();
        let picture = vec![7; layout.bytes()];
        let mut unwritten = Vec::new();
        for seq in 1..=4 {
            buffer.record(|recording| recording.picture::<CameraFrame>(seq, seq, &layout, &picture)).unwrap();
            buffer.chunks();
            buffer.written();
            unwritten.push(buffer.unwritten());
        }
        // A chunk of two pictures exceeds a megabyte: it is closed before the third.
        assert_eq!(unwritten, [1, 2, 1, 2]);
    }

    #[test]
    fn closed_chunks_can_be_written_before_the_flush() {
        let layout = FrameLayout::packed(160, 120, PixelFormat::Grey);
        let (mut buffer, mut disk, mut most) = (buffer(), Vec::new(), 0);
        for seq in 1..=500_u64 {
            // Noise, which does not compress.
            let next = |last: &u64| Some(last.wrapping_mul(0x5851_f42d_4c95_7f2d).wrapping_add(0x1405_7b7e_f767_814f));
            let noise = std::iter::successors(Some(seq << 32), next).map(|state| (state >> 56) as u8);
            let bytes: Vec<u8> = noise.skip(1).take(layout.bytes()).collect();
            record(&mut buffer, seq);
            buffer.record(|recording| recording.picture::<CameraFrame>(seq, seq, &layout, &bytes)).unwrap();
            most = most.max(buffer.chunks().len());
            disk.extend_from_slice(buffer.chunks());
            buffer.written();
        }
        assert!(most > 0 && most < 2 << 20, "{most} bytes at once");
        assert!(disk.len() > 500 * layout.bytes() * 3 / 4, "{} bytes", disk.len());
        disk.extend_from_slice(buffer.finish().unwrap());
        assert_eq!(scans(&disk), (1..=500).collect::<Vec<_>>());
    }
}
