//! What the viewer reads, brought onto the board.

use bus::{BusError, Frame, FrameReader, Reader, Received, Shell};
use messages::{
    CameraFrame, CameraMask, CameraMotion, DeploymentStatus, FilterVerdict, Heartbeat, MapTile, Payload, Pictures, SonarMotion, SonarScan,
    TruthScan, TruthSurfaces, Walkers, WayChunk,
};

use crate::board::{Board, Topic};
use crate::camera;
use crate::scene::Scene;

/// Most messages taken from one input in one round: the heartbeat must not wait for a flood to end.
const MOST_AT_ONCE: usize = 256;

/// The inputs of the viewer.
pub(crate) struct Inputs {
    statuses: Reader<DeploymentStatus>,
    heartbeats: Reader<Heartbeat>,
    scans: Reader<SonarScan>,
    motions: Reader<SonarMotion>,
    walkers: Reader<Walkers>,
    camera_motions: Reader<CameraMotion>,
    verdicts: Reader<FilterVerdict>,
    tiles: Reader<MapTile>,
    way: Reader<WayChunk>,
    truth: Reader<TruthScan>,
    surfaces: Reader<TruthSurfaces>,
    frames: FrameReader<CameraFrame>,
    masks: FrameReader<CameraMask>,
}

/// What a round of taking found.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Taken {
    /// There may be more.
    pub(crate) more: bool,
    /// The scene looks different from before.
    pub(crate) scene: bool,
    /// The newest status, if one came.
    pub(crate) status: Option<DeploymentStatus>,
}

impl Inputs {
    pub(crate) fn open(shell: &mut Shell) -> Result<Self, BusError> {
        Ok(Self {
            statuses: shell.reader()?,
            heartbeats: shell.reader()?,
            scans: shell.reader()?,
            motions: shell.reader()?,
            walkers: shell.reader()?,
            camera_motions: shell.reader()?,
            verdicts: shell.reader()?,
            tiles: shell.reader()?,
            way: shell.reader()?,
            truth: shell.reader()?,
            surfaces: shell.reader()?,
            frames: shell.frame_reader()?,
            masks: shell.frame_reader()?,
        })
    }

    /// Takes what waits, up to a share of each input.
    pub(crate) fn take(&mut self, board: &mut Board, scene: &mut Scene) -> Result<Taken, BusError> {
        let mut taken = Taken::default();
        let Taken { more, scene: seen, status } = &mut taken;
        *more |= drain(&mut self.statuses, |_, _, newest| *status = Some(*newest))?;
        drain(&mut self.heartbeats, |_, _, heartbeat| *seen |= scene.heartbeat(heartbeat))?;
        *more |= drain(&mut self.surfaces, |_, _, surfaces| scene.surfaces(surfaces))?;
        *more |= drain(&mut self.scans, |seq, stamp_ns, scan| {
            scene.scan(seq, stamp_ns, scan);
            *seen = true;
        })?;
        *more |= drain(&mut self.motions, |_, stamp_ns, motion| {
            scene.motion(stamp_ns, motion);
            *seen = true;
        })?;
        *more |= drain(&mut self.walkers, |_, stamp_ns, walkers| {
            scene.walkers(stamp_ns, walkers);
            *seen = true;
        })?;
        *more |= drain(&mut self.camera_motions, |_, _, motion| {
            scene.camera(motion);
            *seen = true;
        })?;
        *more |= drain(&mut self.verdicts, |seq, _, verdict| {
            scene.verdict(seq, verdict);
            *seen = true;
        })?;
        *more |= drain(&mut self.truth, |_, _, truth| {
            scene.truth(truth);
            *seen = true;
        })?;
        *more |= drain(&mut self.tiles, |_, _, tile| board.tile(tile))?;
        *more |= drain(&mut self.way, |_, _, chunk| board.way(chunk))?;
        Ok(taken)
    }

    /// Takes the pictures that wait and puts the newest on the board; when nobody looks, or it is too early for another, they
    /// are let go. True when there is a new one.
    pub(crate) fn take_pictures(&mut self, board: &mut Board, are_wanted: bool) -> Result<bool, BusError> {
        let frame = newest(&mut self.frames)?;
        let mask = newest(&mut self.masks)?;
        let is_new = are_wanted && frame.is_some();
        if let Some(frame) = frame.filter(|_| are_wanted) {
            board.put(Topic::Picture, camera::picture(frame.layout(), frame.format(), frame.bytes()));
        }
        if let Some(mask) = mask.filter(|_| are_wanted) {
            board.put(Topic::Mask, camera::mask(mask.layout(), mask.bytes()));
        }
        Ok(is_new)
    }
}

fn newest<P: Pictures>(reader: &mut FrameReader<P>) -> Result<Option<Frame<P>>, BusError> {
    let mut newest = None;
    for _ in 0..MOST_AT_ONCE {
        match reader.take()? {
            None => break,
            // The one before goes back to its sender before the next is taken.
            Some(Received::Message(frame)) => newest = Some(frame),
            Some(Received::End { .. }) => {}
        }
    }
    Ok(newest)
}

/// Takes what waits, up to a share; true when there may be more.
fn drain<T: Payload>(reader: &mut Reader<T>, mut each: impl FnMut(u64, u64, &T)) -> Result<bool, BusError> {
    for _ in 0..MOST_AT_ONCE {
        match reader.take()? {
            None => return Ok(false),
            Some(Received::Message(message)) => each(message.seq(), message.stamp_ns(), &message),
            Some(Received::End { .. }) => {}
        }
    }
    Ok(true)
}
