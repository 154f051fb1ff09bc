//! Camera motion made from the truth, on the bus in the drive's time.

use bus::{BusError, Writer};
use messages::CameraMotion;
use settings::Settings;

use super::{failings, optics};
use ::simulator::World;
use ::simulator::blobs::Blobs;

/// The camera of a drive whose background subtraction is pretended.
pub(super) struct MotionFeed {
    blobs: Blobs,
    writer: Writer<CameraMotion>,
    /// The next frame: its time since the start of the drive, ns, and what moves in it; `None` at the end of the way.
    next: Option<(u64, CameraMotion)>,
    /// Frames sent, or gone by, so far.
    frames: u64,
    /// Stamp of the last frame sent.
    stamp_ns: u64,
}

impl MotionFeed {
    /// The frames after this time of the drive, ns.
    pub(super) fn new(world: &World, settings: &Settings, writer: Writer<CameraMotion>, driven_ns: u64) -> Self {
        let optics = optics(&settings.camera);
        let failings = failings(&settings.simulator.camera.motion);
        let mut blobs = Blobs::new(world, &optics, &failings, u64::from(settings.simulator.seed.get()));
        let next = blobs.next_frame();
        let mut feed = Self { blobs, writer, next, frames: 0, stamp_ns: 0 };
        while feed.due_ns().is_some_and(|due_ns| due_ns <= driven_ns) {
            feed.advance();
        }
        feed
    }

    /// When the next frame is due, ns since the start of the drive.
    pub(super) fn due_ns(&self) -> Option<u64> {
        self.next.as_ref().map(|(due_ns, _)| *due_ns)
    }

    /// Sends the next frame, of a drive that began at this time on the deployment's clock.
    pub(super) fn send(&mut self, start_ns: u64) -> Result<(), BusError> {
        if let Some((due_ns, motion)) = &self.next {
            self.stamp_ns = start_ns + due_ns;
            self.writer.send(self.frames + 1, self.stamp_ns, motion)?;
        }
        self.advance();
        Ok(())
    }

    /// No more frames will come.
    pub(super) fn end(&mut self) -> Result<(), BusError> {
        self.writer.end(self.frames, self.stamp_ns)
    }

    fn advance(&mut self) {
        self.frames += u64::from(self.next.is_some());
        self.next = self.blobs.next_frame();
    }
}
