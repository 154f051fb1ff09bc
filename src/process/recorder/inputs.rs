//! Everything that is said on the bus, brought onto the tape.

use ::recorder::Tape;
use bus::{BusError, FrameReader, Reader, Received};
use drivelog::{Logged, Recording, WriteError};
use messages::{
    CameraFrame, CameraMotion, DeploymentStatus, FilterVerdict, Heartbeat, LogLine, MapSummary, MapTile, Payload, Pictures, Progress,
    SonarMotion, SonarScan, TruthMask, TruthScan, TruthSurfaces, Walkers, WayChunk,
};
use runtime::{Shell, StepError};

/// Most messages taken from one input in one step: the heartbeat must not wait for a flood to end.
const MOST_AT_ONCE: usize = 256;
/// As many pictures; one takes up to 2 ms.
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
    way: Input<WayChunk>,
    summaries: Input<MapSummary>,
    truth: Input<TruthScan>,
    surfaces: Input<TruthSurfaces>,
    heartbeats: Input<Heartbeat>,
    progress: Input<Progress>,
    lines: Input<LogLine>,
}

/// What a round of taking found.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Taken {
    /// There may be more.
    pub(super) more: bool,
    /// Scans among it.
    pub(super) scans: u64,
    /// Camera frames among it.
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
            way: Input::open(shell)?,
            summaries: Input::open(shell)?,
            truth: Input::open(shell)?,
            surfaces: Input::open(shell)?,
            heartbeats: Input::open(shell)?,
            progress: Input::open(shell)?,
            lines: Input::open(shell)?,
        })
    }

    /// Takes what waits, up to a share for each input; `look` sees the statuses, which come first: what a process sent before it
    /// was over waits already when the status says that it is.
    pub(super) fn take(&mut self, tape: &mut Tape, look: impl FnMut(&DeploymentStatus)) -> Result<Taken, StepError> {
        let before = (self.scans.place.taken, self.frames.as_ref().map_or(0, |frames| frames.place.taken));
        let more = self.statuses.drain(tape, Recording::report, look)?
            | self.scans.drain(tape, Recording::scan, |_| ())?
            | self.frames.as_mut().map_or(Ok(false), |frames| frames.drain(tape))?
            | self.masks.as_mut().map_or(Ok(false), |masks| masks.drain(tape))?
            | self.motions.drain(tape, Recording::message, |_| ())?
            | self.camera_motions.drain(tape, Recording::message, |_| ())?
            | self.verdicts.drain(tape, Recording::message, |_| ())?
            | self.walkers.drain(tape, Recording::message, |_| ())?
            | self.tiles.drain(tape, Recording::tile, |_| ())?
            | self.way.drain(tape, Recording::message, |_| ())?
            | self.summaries.drain(tape, Recording::message, |_| ())?
            | self.truth.drain(tape, Recording::message, |_| ())?
            | self.surfaces.drain(tape, Recording::report, |_| ())?
            | self.heartbeats.drain(tape, Recording::report, |_| ())?
            | self.progress.drain(tape, Recording::report, |_| ())?
            | self.lines.drain(tape, Recording::report, |_| ())?;
        let frames = self.frames.as_ref().map_or(0, |frames| frames.place.taken);
        Ok(Taken { more, scans: self.scans.place.taken - before.0, frames: frames - before.1 })
    }

    /// Leaves out scans and frames up to these: they are in the log already.
    pub(super) fn skip_to(&mut self, scan: u64, frame: u64) {
        self.scans.reader.skip_to(scan, 0);
        if let Some(frames) = &mut self.frames {
            frames.reader.skip_to(frame, 0);
        }
    }

    /// The last scan taken.
    pub(super) fn last_scan(&self) -> u64 {
        self.scans.place.last_seq
    }

    /// The last camera frame taken; `None` when they are not recorded.
    pub(super) fn last_frame(&self) -> Option<u64> {
        self.frames.as_ref().map(|frames| frames.place.last_seq)
    }
}

/// How far an input has been taken.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
struct Place {
    /// Messages.
    taken: u64,
    /// The last one that was taken, or that does not come.
    last_seq: u64,
    /// Stamp of the last one that was taken.
    last_stamp_ns: u64,
}

impl Place {
    fn message(&mut self, seq: u64, stamp_ns: u64) {
        (self.last_seq, self.last_stamp_ns) = (seq, stamp_ns);
        self.taken += 1;
    }

    /// What was lost or refused before the end does not come any more.
    fn end(&mut self, seq: u64) {
        self.last_seq = self.last_seq.max(seq);
    }
}

struct Input<T: Payload> {
    reader: Reader<T>,
    place: Place,
}

impl<T: Logged> Input<T> {
    fn open(shell: &mut Shell) -> Result<Self, BusError> {
        Ok(Self { reader: shell.reader()?, place: Place::default() })
    }

    /// Takes what waits, up to a share; true when there may be more.
    fn drain(
        &mut self,
        tape: &mut Tape,
        put: fn(&mut Recording, u64, u64, &T) -> Result<(), WriteError>,
        mut look: impl FnMut(&T),
    ) -> Result<bool, StepError> {
        for _ in 0..MOST_AT_ONCE {
            match self.reader.take()? {
                None => return Ok(false),
                Some(Received::Message(message)) => {
                    self.place.message(message.seq(), message.stamp_ns());
                    look(&message);
                    tape.record(|recording| put(recording, message.seq(), message.stamp_ns(), &message))?;
                }
                Some(Received::End { seq }) => {
                    self.place.end(seq);
                    tape.record(|recording| recording.end::<T>(seq, self.place.last_stamp_ns))?;
                }
            }
        }
        Ok(true)
    }
}

struct PictureInput<P: Pictures> {
    reader: FrameReader<P>,
    place: Place,
}

impl<P: Pictures> PictureInput<P> {
    fn open(shell: &mut Shell) -> Result<Self, BusError> {
        Ok(Self { reader: shell.frame_reader()?, place: Place::default() })
    }

    /// Takes what waits, up to a share; true when there may be more.
    fn drain(&mut self, tape: &mut Tape) -> Result<bool, StepError> {
        for _ in 0..MOST_PICTURES_AT_ONCE {
            match self.reader.take()? {
                None => return Ok(false),
                Some(Received::Message(frame)) => {
                    self.place.message(frame.seq(), frame.stamp_ns());
                    let (layout, bytes) = (frame.layout(), frame.bytes());
                    tape.record(|recording| recording.picture::<P>(frame.seq(), frame.stamp_ns(), &layout, bytes))?;
                }
                Some(Received::End { seq }) => {
                    self.place.end(seq);
                    tape.record(|recording| recording.end_of_pictures::<P>(seq, self.place.last_stamp_ns))?;
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
    fn a_last_message_that_is_refused_is_answered_for_by_the_end() {
        let domain = Domain::open(&format!("test-recorder-{}", std::process::id()), 1.0).unwrap();
        let mut shell = Shell::join(domain.membership_for("recorder", 0, "settings.toml".as_ref())).unwrap();
        let mut inputs = Inputs::open(&mut shell, true).unwrap();
        let mut scans: Writer<SonarScan> = shell.writer().unwrap();
        let mut frames: FrameWriter<CameraFrame> = shell.frame_writer().unwrap();
        let scan = SonarScan::new(Pose::default(), &[], false);
        let layout = FrameLayout::packed(20, 16, PixelFormat::Grey);
        // The third lies before the second in time.
        for (seq, stamp_ns) in [(1, 100), (2, 200), (3, 150)] {
            scans.send(seq, stamp_ns, &scan).unwrap();
            frames.send(seq, stamp_ns, layout, &[0; 320]).unwrap();
        }
        scans.end(3, 200).unwrap();
        frames.end(3, 200).unwrap();
        let preamble = Preamble { run: 1, robot: "pioneer-1".into(), sonars: Vec::new(), origin: "a test".into(), settings: String::new() };
        let taken = inputs.take(&mut Tape::new(&preamble).unwrap(), |_| ()).unwrap();
        assert_eq!(taken, Taken { more: false, scans: 2, frames: 2 });
        assert_eq!((inputs.last_scan(), inputs.last_frame()), (3, Some(3)));
        drop((inputs, scans, frames, shell));
        domain.close().unwrap();
    }
}
