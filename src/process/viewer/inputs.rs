//! What the viewer reads, brought onto the board and to whoever has subscribed.

use ::viewer::foxglove::Feed;
use ::viewer::{Board, Scene, Topic, camera};
use bus::{BusError, Frame, FrameReader, Reader, Received};
use messages::{
    CameraFrame, CameraMask, CameraMotion, DeploymentStatus, FilterVerdict, Heartbeat, LogLine, MapTile, Payload, Pictures, SonarMotion,
    SonarScan, TruthScan, TruthSurfaces, Walkers, WayChunk,
};
use runtime::Shell;
use std::net::TcpStream;

/// Most messages taken from one input in one round: the heartbeat must not wait for a flood to end.
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
    way: Reader<WayChunk>,
    truth: Reader<TruthScan>,
    surfaces: Reader<TruthSurfaces>,
    lines: Reader<LogLine>,
    frames: FrameReader<CameraFrame>,
    masks: FrameReader<CameraMask>,
}

/// What a round of taking found.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Taken {
    /// There may be more.
    pub(super) more: bool,
    /// The scene looks different from before.
    pub(super) scene: bool,
    /// The newest status, if one came.
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
            way: shell.reader()?,
            truth: shell.reader()?,
            surfaces: shell.reader()?,
            lines: shell.reader()?,
            frames: shell.frame_reader()?,
            masks: shell.frame_reader()?,
        })
    }

    /// Takes what waits, up to a share of each input.
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
        *more |= drain(&mut self.way, |_, _, chunk| board.way(chunk))?;
        Ok(taken)
    }

    /// Takes the camera's pictures that wait and puts the newest on the board; unless one is wanted, they are let go. True when
    /// there is a new one.
    pub(super) fn take_picture(&mut self, board: &mut Board, feed: &mut Feed<TcpStream>, is_wanted: bool) -> Result<bool, BusError> {
        let Some(frame) = newest(&mut self.frames)?.filter(|_| is_wanted) else { return Ok(false) };
        board.put(Topic::Picture, camera::picture(frame.layout(), frame.format(), frame.bytes()));
        show(feed, &frame);
        Ok(true)
    }

    /// Takes the masks that wait, likewise: they come later than their pictures.
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
