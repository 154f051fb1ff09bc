//! What the robot's camera sees, on the bus in the drive's time, with the truth of every pixel.

use bus::{BusError, FrameWriter};
use messages::{CameraFrame, FrameLayout, PixelFormat, TruthMask};
use runtime::Shell;
use settings::Settings;

use super::optics;
use ::simulator::World;
use ::simulator::camera::{Camera, Flaws, Picture};

/// The camera of a drive, whose pictures are rendered.
pub(super) struct PictureFeed {
    camera: Camera,
    layout: FrameLayout,
    picture: Picture,
    frames: FrameWriter<CameraFrame>,
    masks: FrameWriter<TruthMask>,
    /// Number of the last frame that was sent, or that has gone by.
    last: u64,
    /// Stamp of the last frame sent.
    stamp_ns: u64,
}

impl PictureFeed {
    /// The frames after this time of the drive, ns.
    pub(super) fn new(world: &World, settings: &Settings, shell: &mut Shell, driven_ns: u64) -> Result<Self, BusError> {
        let optics = optics(&settings.camera);
        let [width, height] = optics.size_px;
        Ok(Self {
            camera: Camera::new(world, &optics, &Flaws::default(), u64::from(settings.simulator.seed.get())),
            layout: FrameLayout::packed(width, height, PixelFormat::Grey),
            picture: Picture::default(),
            frames: shell.frame_writer()?,
            masks: shell.frame_writer()?,
            last: driven_ns / optics.interval_ns.max(1),
            stamp_ns: 0,
        })
    }

    /// When the next frame is due, ns since the start of the drive; `None` at its end.
    pub(super) fn due_ns(&self) -> Option<u64> {
        let next = self.last + 1;
        (next <= self.camera.total_frames()).then(|| self.camera.stamp_ns(next))
    }

    /// Number of the last frame that was sent.
    pub(super) fn last(&self) -> u64 {
        self.last
    }

    /// Takes and sends the next frame, of a drive that began at this time on the deployment's clock.
    pub(super) fn send(&mut self, start_ns: u64) -> Result<(), BusError> {
        self.last += 1;
        self.stamp_ns = start_ns + self.camera.stamp_ns(self.last);
        self.camera.take(self.last, &mut self.picture);
        self.frames.send(self.last, self.stamp_ns, self.layout, &self.picture.grey)?;
        self.masks.send(self.last, self.stamp_ns, self.layout, &self.picture.labels)
    }

    /// No more frames will come.
    pub(super) fn end(&mut self) -> Result<(), BusError> {
        self.frames.end(self.last, self.stamp_ns)?;
        self.masks.end(self.last, self.stamp_ns)
    }
}
