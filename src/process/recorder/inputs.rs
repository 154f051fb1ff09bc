//! The services that are recorded.

use ::recorder::LogBuffer;
use bus::{BusError, FrameReader, Reader, Received};
use drivelog::{Logged, Recording, WriteError};
use messages::{
    CameraFrame, CameraMotion, DeploymentStatus, FilterVerdict, Heartbeat, LogLine, MapSummary, MapTile, Payload, Pictures, Progress,
    SonarMotion, SonarScan, TruthMask, TruthScan, TruthSurfaces, Walkers, WayChunk,
};
use runtime::{Shell, StepError};

/// Most messages taken from one input in one step, so that a flood does not delay the heartbeat.
const MOST_AT_ONCE: usize = 256;
/// Most pictures taken in one step: recording one takes up to 2 ms.
const MOST_PICTURES_AT_ONCE: usize = 16;

/// The inputs of the recorder.
pub(super) struct Inputs {
    statuses: Input<DeploymentStatus>,
    scans: Input<SonarScan>,
    /// `None` when pictures are not recorded.
    frames: Option<PictureInput<CameraFrame>>,
    masks: Option<PictureInput<TruthMask>>,
    motions: Input<SonarMotion>,
    camera_motions: Input<CameraMotion>,
    verdicts: Input<FilterVerdict>,
    walkers: Input<Walkers>,
    tiles: Input<MapTile>,
    path: Input<WayChunk>,
    summaries: Input<MapSummary>,
    truth: Input<TruthScan>,
    surfaces: Input<TruthSurfaces>,
    heartbeats: Input<Heartbeat>,
    progress: Input<Progress>,
    lines: Input<LogLine>,
}

/// What one step has taken.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Taken {
    /// More messages may wait.
    pub(super) more: bool,
    /// Number of scans.
    pub(super) scans: u64,
    /// Number of camera frames.
    pub(super) frames: u64,
}

impl Inputs {
    pub(super) fn open(shell: &mut Shell, pictures: bool) -> Result<Self, BusError> {
        Ok(Self {
            statuses: Input::open(shell)?,
            scans: Input::open(shell)?,
            frames: if pictures { Some(PictureInput::open(shell)?) } else { None },
            masks: if pictures { Some(PictureInput::open(shell)?) } else { None },
            motions: Input::open(shell)?,
            camera_motions: Input::open(shell)?,
            verdicts: Input::open(shell)?,
            walkers: Input::open(shell)?,
            tiles: Input::open(shell)?,
            path: Input::open(shell)?,
            summaries: Input::open(shell)?,
            truth: Input::open(shell)?,
            surfaces: Input::open(shell)?,
            heartbeats: Input::open(shell)?,
            progress: Input::open(shell)?,
            lines: Input::open(shell)?,
        })
    }

    /// Takes what waits, up to a limit for each input. Statuses come first and are passed to `look`: when a status says that a process
    /// is over, everything that the process sent waits already.
    pub(super) fn take(&mut self, buffer: &mut LogBuffer, look: impl FnMut(&DeploymentStatus)) -> Result<Taken, StepError> {
        let before = (self.scans.cursor.taken, self.frames.as_ref().map_or(0, |frames| frames.cursor.taken));
        let more = self.statuses.drain(buffer, Recording::report, look)?
            | self.scans.drain(buffer, Recording::scan, |_| ())?
            | self.frames.as_mut().map_or(Ok(false), |frames| frames.drain(buffer))?
            | self.masks.as_mut().map_or(Ok(false), |masks| masks.drain(buffer))?
            | self.motions.drain(buffer, Recording::message, |_| ())?
            | self.camera_motions.drain(buffer, Recording::message, |_| ())?
            | self.verdicts.drain(buffer, Recording::message, |_| ())?
            | self.walkers.drain(buffer, Recording::message, |_| ())?
            | self.tiles.drain(buffer, Recording::tile, |_| ())?
            | self.path.drain(buffer, Recording::message, |_| ())?
            | self.summaries.drain(buffer, Recording::message, |_| ())?
            | self.truth.drain(buffer, Recording::message, |_| ())?
            | self.surfaces.drain(buffer, Recording::report, |_| ())?
            | self.heartbeats.drain(buffer, Recording::report, |_| ())?
            | self.progress.drain(buffer, Recording::report, |_| ())?
            | self.lines.drain(buffer, Recording::report, |_| ())?;
        let frames = self.frames.as_ref().map_or(0, |frames| frames.cursor.taken);
        Ok(Taken { more, scans: self.scans.cursor.taken - before.0, frames: frames - before.1 })
    }

    /// Skips scans and frames up to these, which are in the log.
    pub(super) fn skip_to(&mut self, scan: u64, frame: u64) {
        self.scans.reader.skip_to(scan, 0);
        if let Some(frames) = &mut self.frames {
            frames.reader.skip_to(frame, 0);
        }
    }

    /// The last scan taken.
    pub(super) fn last_scan(&self) -> u64 {
        self.scans.cursor.last_seq
    }

    /// The last camera frame taken; `None` when frames are not recorded.
    pub(super) fn last_frame(&self) -> Option<u64> {
        self.frames.as_ref().map(|frames| frames.cursor.last_seq)
    }
}

/// Position in a stream.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
struct Cursor {
    /// Number of messages taken.
    taken: u64,
    /// The last message taken, or the end of the stream.
    last_seq: u64,
    /// Stamp of the last message taken.
    last_stamp_ns: u64,
}

impl Cursor {
    fn message(&mut self, seq: u64, stamp_ns: u64) {
        (self.last_seq, self.last_stamp_ns) = (seq, stamp_ns);
        self.taken += 1;
    }

    /// Messages before the end that were lost or refused do not come any more.
    fn end(&mut self, seq: u64) {
        self.last_seq = self.last_seq.max(seq);
    }
}

struct Input<T: Payload> {
    reader: Reader<T>,
    cursor: Cursor,
}

impl<T: Logged> Input<T> {
    fn open(shell: &mut Shell) -> Result<Self, BusError> {
        Ok(Self { reader: shell.reader()?, cursor: Cursor::default() })
    }

    /// Takes what waits, up to a limit; true when there may be more.
    fn drain(
        &mut self,
        buffer: &mut LogBuffer,
        add: fn(&mut Recording, u64, u64, &T) -> Result<(), WriteError>,
        mut look: impl FnMut(&T),
    ) -> Result<bool, StepError> {
        for _ in 0..MOST_AT_ONCE {
            match self.reader.take()? {
                None => return Ok(false),
                Some(Received::Message(message)) => {
                    self.cursor.message(message.seq(), message.stamp_ns());
                    look(&message);
                    buffer.record(|recording| add(recording, message.seq(), message.stamp_ns(), &message))?;
                }
                Some(Received::End { seq }) => {
                    self.cursor.end(seq);
                    buffer.record(|recording| recording.end::<T>(seq, self.cursor.last_stamp_ns))?;
                }
            }
        }
        Ok(true)
    }
}

struct PictureInput<P: Pictures> {
    reader: FrameReader<P>,
    cursor: Cursor,
}

impl<P: Pictures> PictureInput<P> {
    fn open(shell: &mut Shell) -> Result<Self, BusError> {
        Ok(Self { reader: shell.frame_reader()?, cursor: Cursor::default() })
    }

    /// Takes what waits, up to a limit; true when there may be more.
    fn drain(&mut self, buffer: &mut LogBuffer) -> Result<bool, StepError> {
        for _ in 0..MOST_PICTURES_AT_ONCE {
            match self.reader.take()? {
                None => return Ok(false),
                Some(Received::Message(frame)) => {
                    self.cursor.message(frame.seq(), frame.stamp_ns());
                    let (layout, bytes) = (frame.layout(), frame.bytes());
                    buffer.record(|recording| recording.picture::<P>(frame.seq(), frame.stamp_ns(), &layout, bytes))?;
                }
                Some(Received::End { seq }) => {
                    self.cursor.end(seq);
                    buffer.record(|recording| recording.end_of_pictures::<P>(seq, self.cursor.last_stamp_ns))?;
                }
            }
        }
        Ok(true)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use bus::{Domain, FrameWriter, Writer};
    use drivelog::Preamble;
    use messages::{FrameLayout, PixelFormat, Pose};

    #[test]
    fn the_end_acknowledges_a_refused_last_message() {
        let domain = Domain::open(&format!("test-recorder-{}", std::process::id()), 1.0).unwrap();
        let mut shell = Shell::join(domain.membership_for("recorder", 0, "settings.toml".as_ref())).unwrap();
        let mut inputs = Inputs::open(&mut shell, true).unwrap();
        let mut scans: Writer<SonarScan> = shell.writer().unwrap();
        let mut frames: FrameWriter<CameraFrame> = shell.frame_writer().unwrap();
        let scan = SonarScan::new(Pose::default(), &[], false);
        let layout = FrameLayout::packed(20, 16, PixelFormat::Grey);
        // The stamp of the third is before that of the second.
        for (seq, stamp_ns) in [(1, 100), (2, 200), (3, 150)] {
            scans.send(seq, stamp_ns, &scan).unwrap();
            frames.send(seq, stamp_ns, layout, &[0; 320]).unwrap();
        }
        scans.end(3, 200).unwrap();
        frames.end(3, 200).unwrap();
        let preamble = Preamble { run: 1, robot: "pioneer-1".into(), sonars: Vec::new(), origin: "a test".into(), settings: String::new() };
        let taken = inputs.take(&mut LogBuffer::new(&preamble).unwrap(), |_| ()).unwrap();
        assert_eq!(taken, Taken { more: false, scans: 2, frames: 2 });
        assert_eq!((inputs.last_scan(), inputs.last_frame()), (3, Some(3)));
        drop((inputs, scans, frames, shell));
        domain.close().unwrap();
    }
}
