//! Everything that is said on the bus, brought onto the tape.

use bus::{BusError, FrameReader, Reader, Received, Shell, StepError};
use drivelog::{Logged, Recording, WriteError};
use messages::{
    CameraFrame, CameraMotion, DeploymentStatus, FilterVerdict, Heartbeat, LogLine, MapSummary, MapTile, Payload, Pictures, Progress,
    SonarMotion, SonarScan, TruthMask, TruthScan, TruthSurfaces, Walkers, WayChunk,
};

use crate::tape::Tape;

/// Most messages taken from one input in one step: the heartbeat must not wait for a flood to end.
const MOST_AT_ONCE: usize = 256;
/// As many pictures; one takes up to 2 ms.
const MOST_PICTURES_AT_ONCE: usize = 16;

/// The inputs of the recorder.
pub(crate) struct Inputs {
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
pub(crate) struct Taken {
    /// There may be more.
    pub(crate) more: bool,
    /// Scans among it.
    pub(crate) scans: u64,
    /// Camera frames among it.
    pub(crate) frames: u64,
}

impl Inputs {
    pub(crate) fn open(shell: &mut Shell, pictures: bool) -> Result<Self, BusError> {
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
    pub(crate) fn take(&mut self, tape: &mut Tape, look: impl FnMut(&DeploymentStatus)) -> Result<Taken, StepError> {
        let before = (self.scans.taken, self.frames.as_ref().map_or(0, |frames| frames.taken));
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
        let frames = self.frames.as_ref().map_or(0, |frames| frames.taken);
        Ok(Taken { more, scans: self.scans.taken - before.0, frames: frames - before.1 })
    }

    /// Leaves out scans and frames up to these: they are in the log already.
    pub(crate) fn skip_to(&mut self, scan: u64, frame: u64) {
        self.scans.reader.skip_to(scan, 0);
        if let Some(frames) = &mut self.frames {
            frames.reader.skip_to(frame, 0);
        }
    }

    /// The last scan taken.
    pub(crate) fn last_scan(&self) -> u64 {
        self.scans.last_seq
    }

    /// The last camera frame taken; `None` when they are not recorded.
    pub(crate) fn last_frame(&self) -> Option<u64> {
        self.frames.as_ref().map(|frames| frames.last_seq)
    }
}

struct Input<T: Payload> {
    reader: Reader<T>,
    taken: u64,
    last_seq: u64,
    last_stamp_ns: u64,
}

impl<T: Logged> Input<T> {
    fn open(shell: &mut Shell) -> Result<Self, BusError> {
        Ok(Self { reader: shell.reader()?, taken: 0, last_seq: 0, last_stamp_ns: 0 })
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
                    (self.last_seq, self.last_stamp_ns) = (message.seq(), message.stamp_ns());
                    self.taken += 1;
                    look(&message);
                    tape.record(|recording| put(recording, message.seq(), message.stamp_ns(), &message))?;
                }
                Some(Received::End { seq }) => {
                    // What was lost before the end does not come any more.
                    self.last_seq = self.last_seq.max(seq);
                    tape.record(|recording| recording.end::<T>(seq, self.last_stamp_ns))?;
                }
            }
        }
        Ok(true)
    }
}

struct PictureInput<P: Pictures> {
    reader: FrameReader<P>,
    taken: u64,
    last_seq: u64,
    last_stamp_ns: u64,
}

impl<P: Pictures> PictureInput<P> {
    fn open(shell: &mut Shell) -> Result<Self, BusError> {
        Ok(Self { reader: shell.frame_reader()?, taken: 0, last_seq: 0, last_stamp_ns: 0 })
    }

    /// Takes what waits, up to a share; true when there may be more.
    fn drain(&mut self, tape: &mut Tape) -> Result<bool, StepError> {
        for _ in 0..MOST_PICTURES_AT_ONCE {
            match self.reader.take()? {
                None => return Ok(false),
                Some(Received::Message(frame)) => {
                    (self.last_seq, self.last_stamp_ns) = (frame.seq(), frame.stamp_ns());
                    self.taken += 1;
                    let (layout, bytes) = (frame.layout(), frame.bytes());
                    tape.record(|recording| recording.picture::<P>(frame.seq(), frame.stamp_ns(), &layout, bytes))?;
                }
                Some(Received::End { seq }) => tape.record(|recording| recording.end_of_pictures::<P>(seq, self.last_stamp_ns))?,
            }
        }
        Ok(true)
    }
}
