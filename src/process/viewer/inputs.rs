//! The services that the viewer shows.

use ::viewer::foxglove::Feed;
use ::viewer::{Board, Scene, Topic, camera};
use bus::{BusError, Frame, FrameReader, Reader, Received};
use messages::{
    CameraFrame, CameraMask, CameraMotion, DeploymentStatus, FilterVerdict, Heartbeat, LogLine, MapTile, Payload, Pictures, SonarMotion,
    SonarScan, TruthScan, TruthSurfaces, Walkers, WayChunk,
};
use runtime::Shell;
use std::net::TcpStream;

/// Most messages taken from one input in one step, so that a flood does not delay the heartbeat.
const MOST_AT_ONCE: usize = 256;

/// The inputs of the viewer.
pub(super) struct Inputs {
    statuses: Reader<DeploymentStatus>,
    heartbeats: Reader<Heartbeat>,
    scans: Reader<SonarScan>,
    motions: Reader<SonarMotion>,
    walkers: Reader<Walkers>,
    camera_motions: Reader<CameraMotion>,
    verdicts: Reader<FilterVerdict>,
    tiles: Reader<MapTile>,
    path: Reader<WayChunk>,
    truth: Reader<TruthScan>,
    surfaces: Reader<TruthSurfaces>,
    lines: Reader<LogLine>,
    frames: FrameReader<CameraFrame>,
    masks: FrameReader<CameraMask>,
}

/// What one step has taken.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Taken {
    /// More messages may wait.
    pub(super) more: bool,
    /// The scene has changed.
    pub(super) scene: bool,
    /// The newest status, if one was received.
    pub(super) status: Option<DeploymentStatus>,
}

impl Inputs {
    pub(super) fn open(shell: &mut Shell) -> Result<Self, BusError> {
        Ok(Self {
            statuses: shell.reader()?,
            heartbeats: shell.reader()?,
            scans: shell.reader()?,
            motions: shell.reader()?,
            walkers: shell.reader()?,
            camera_motions: shell.reader()?,
            verdicts: shell.reader()?,
            tiles: shell.reader()?,
            path: shell.reader()?,
            truth: shell.reader()?,
            surfaces: shell.reader()?,
            lines: shell.reader()?,
            frames: shell.frame_reader()?,
            masks: shell.frame_reader()?,
        })
    }

    /// Takes what waits, up to a limit for each input, and passes it to board, scene and feed.
    pub(super) fn take(&mut self, board: &mut Board, scene: &mut Scene, feed: &mut Feed<TcpStream>) -> Result<Taken, BusError> {
        let mut taken = Taken::default();
        let Taken { more, scene: seen, status } = &mut taken;
        *more |= drain(&mut self.statuses, |seq, stamp_ns, newest| {
            *status = Some(*newest);
            feed.report(seq, stamp_ns, newest);
        })?;
        drain(&mut self.heartbeats, |seq, stamp_ns, heartbeat| {
            *seen |= scene.heartbeat(heartbeat);
            feed.report(seq, stamp_ns, heartbeat);
        })?;
        *more |= drain(&mut self.lines, |seq, stamp_ns, line| feed.report(seq, stamp_ns, line))?;
        *more |= drain(&mut self.surfaces, |_, _, surfaces| scene.surfaces(surfaces))?;
        *more |= drain(&mut self.scans, |seq, stamp_ns, scan| {
            scene.scan(seq, stamp_ns, scan);
            feed.scan(seq, stamp_ns, scan);
            *seen = true;
        })?;
        *more |= drain(&mut self.motions, |seq, stamp_ns, motion| {
            scene.motion(stamp_ns, motion);
            feed.message(seq, stamp_ns, motion);
            *seen = true;
        })?;
        *more |= drain(&mut self.walkers, |seq, stamp_ns, walkers| {
            scene.walkers(stamp_ns, walkers);
            feed.message(seq, stamp_ns, walkers);
            *seen = true;
        })?;
        *more |= drain(&mut self.camera_motions, |seq, stamp_ns, motion| {
            scene.camera(motion);
            feed.message(seq, stamp_ns, motion);
            *seen = true;
        })?;
        *more |= drain(&mut self.verdicts, |seq, stamp_ns, verdict| {
            scene.verdict(seq, verdict);
            feed.message(seq, stamp_ns, verdict);
            *seen = true;
        })?;
        *more |= drain(&mut self.truth, |seq, stamp_ns, truth| {
            scene.truth(truth);
            feed.message(seq, stamp_ns, truth);
            *seen = true;
        })?;
        *more |= drain(&mut self.tiles, |seq, stamp_ns, tile| {
            board.tile(tile);
            feed.tile(seq, stamp_ns, tile);
        })?;
        *more |= drain(&mut self.path, |_, _, chunk| board.path(chunk))?;
        Ok(taken)
    }

    /// Takes the waiting pictures and shows the newest if one is wanted. True if one is shown.
    pub(super) fn take_picture(&mut self, board: &mut Board, feed: &mut Feed<TcpStream>, is_wanted: bool) -> Result<bool, BusError> {
        let Some(frame) = newest(&mut self.frames)?.filter(|_| is_wanted) else { return Ok(false) };
        board.put(Topic::Picture, camera::picture(frame.layout(), frame.format(), frame.bytes()));
        show(feed, &frame);
        Ok(true)
    }

    /// The same for masks, which are published later than their pictures.
    pub(super) fn take_mask(&mut self, board: &mut Board, feed: &mut Feed<TcpStream>, is_wanted: bool) -> Result<bool, BusError> {
        let Some(mask) = newest(&mut self.masks)?.filter(|_| is_wanted) else { return Ok(false) };
        board.put(Topic::Mask, camera::mask(mask.layout(), mask.bytes()));
        show(feed, &mask);
        Ok(true)
    }
}

fn show<P: Pictures>(feed: &mut Feed<TcpStream>, frame: &Frame<P>) {
    feed.picture::<P>(frame.seq(), frame.stamp_ns(), &frame.layout(), frame.bytes());
}

fn newest<P: Pictures>(reader: &mut FrameReader<P>) -> Result<Option<Frame<P>>, BusError> {
    let mut newest = None;
    for _ in 0..MOST_AT_ONCE {
        match reader.take()? {
            None => break,
            // This releases the previous one: its sender has few slots.
            Some(Received::Message(frame)) => newest = Some(frame),
            Some(Received::End { .. }) => {}
        }
    }
    Ok(newest)
}

/// Takes what waits, up to a limit; true when there may be more.
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
