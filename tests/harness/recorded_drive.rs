//! Logs of simulated drives, made without a deployment: the same bytes every time, however busy the machine is.

use std::path::PathBuf;

use drivelog::{Preamble, Recording};
use evaluate::Drive;
use messages::{CameraFrame, FrameLayout, PixelFormat, SonarScan};
use settings::Settings;
use simulator::camera::{Camera, Flaws, Picture};
use simulator::{Optics, World};

use super::{Deployment, Sandbox};

/// A log to be written into the sandboxes of several tests.
pub(crate) struct RecordedDrive(Vec<u8>);

impl RecordedDrive {
    /// The log of a drive of this deployment with the stamps of the simulation: scans, and pictures if wanted.
    pub(crate) fn of(deployment: &Deployment, pictures: bool) -> Self {
        Self(log_of(deployment, pictures))
    }

    /// Writes the file.
    pub(crate) fn write(&self, sandbox: &Sandbox) -> PathBuf {
        let path = sandbox.path("recorded.mcap");
        std::fs::write(&path, &self.0).unwrap();
        path
    }
}

fn log_of(deployment: &Deployment, pictures: bool) -> Vec<u8> {
    let settings = Settings::parse("drive.toml", &deployment.to_toml()).unwrap();
    let world = world_file::read(&settings.simulator.world).unwrap();
    let (body, seed) = (stillmap::process::robot::body(&settings.robot), settings.simulator.seed.get().into());
    let preamble = Preamble {
        run: 1,
        robot: "pioneer-1".to_owned(),
        sonars: body.ring().to_vec(),
        origin: "a simulated drive of a test".to_owned(),
        settings: deployment.to_toml(),
    };
    let mut recording = Recording::new(&preamble).unwrap();
    let mut camera = pictures.then(|| Pictures::new(&world, seed));
    let drive = Drive::through(&world, &body, settings.robot.range_limit_m.get(), None, seed);
    for scan in &drive.scans {
        if let Some(camera) = &mut camera {
            camera.record_before(scan.stamp_ns, &mut recording);
        }
        recording.scan(scan.seq, scan.stamp_ns, &scan.scan).unwrap();
    }
    let last = drive.scans.last().unwrap();
    recording.end::<SonarScan>(last.seq, last.stamp_ns).unwrap();
    if let Some(camera) = camera {
        recording.end_of_pictures::<CameraFrame>(camera.last, camera.camera.stamp_ns(camera.last)).unwrap();
    }
    recording.finish().unwrap()
}

/// The pictures of the default camera.
struct Pictures {
    camera: Camera,
    layout: FrameLayout,
    picture: Picture,
    /// The number of the last recorded picture.
    last: u64,
}

impl Pictures {
    fn new(world: &World, seed: u64) -> Self {
        let optics = Optics::default();
        let [width, height] = optics.size_px;
        let layout = FrameLayout::packed(width, height, PixelFormat::Grey);
        Self { camera: Camera::new(world, &optics, &Flaws::default(), seed), layout, picture: Picture::default(), last: 0 }
    }

    fn record_before(&mut self, stamp_ns: u64, recording: &mut Recording) {
        while self.last < self.camera.total_frames() && self.camera.stamp_ns(self.last + 1) <= stamp_ns {
            self.last += 1;
            self.camera.take(self.last, &mut self.picture);
            recording.picture::<CameraFrame>(self.last, self.camera.stamp_ns(self.last), &self.layout, &self.picture.grey).unwrap();
        }
    }
}
