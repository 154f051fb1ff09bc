//! A drive through a simulated world, recorded: what every sense said, and the truth behind it.

use messages::{CameraMotion, FrameLayout, PixelFormat, SonarReading, SonarScan};
use simulator::camera::{Camera, Flaws, Picture};
use simulator::{Body, CalibrationError, Optics, Simulation, World};

use crate::scan::Scan;
use crate::truth::Truth;

/// What moves in a frame of the camera.
#[derive(Debug, Clone)]
pub struct Frame {
    /// Since the start of the drive.
    pub stamp_ns: u64,
    /// As background subtraction reports it.
    pub motion: CameraMotion,
}

/// The camera of a drive and the background subtraction behind it.
#[derive(Debug, Clone, PartialEq)]
pub struct CameraSetup {
    /// As the robot takes the camera to be.
    pub optics: Optics,
    /// How far the camera as built is from that.
    pub calibration: CalibrationError,
    /// How its pictures fall short of perfect ones.
    pub flaws: Flaws,
    /// SBS.
    pub sbs: sbs::Parameters,
}

impl CameraSetup {
    /// A usual camera of these optics, with SBS's default parameters.
    #[must_use]
    pub fn new(optics: Optics) -> Self {
        let horizon = optics.horizon_share.clamp(0.0, 1.0) as f32;
        let sbs = sbs::Parameters { horizon, field_of_view_rad: optics.field_of_view_rad, ..sbs::Parameters::default() };
        Self { optics, calibration: CalibrationError::default(), flaws: Flaws::default(), sbs }
    }

    /// What SBS reports of each rendered picture of a drive.
    fn frames(&self, world: &World, seed: u64) -> Vec<Frame> {
        let built = self.optics.as_built(&self.calibration, seed);
        let mut lens = Camera::new(world, &built, &self.flaws, seed);
        let [width, height] = built.size_px;
        let layout = FrameLayout::packed(width, height, PixelFormat::Grey);
        let (mut state, mut picture) = (sbs::State::new(self.sbs.clone()), Picture::default());
        (1..=lens.total_frames())
            .map(|number| {
                lens.take(number, &mut picture);
                let stamp_ns = lens.stamp_ns(number);
                let answer = state.step(&sbs::Frame { stamp_ns, layout, bytes: &picture.grey, odometry: None });
                Frame { stamp_ns, motion: answer.motion }
            })
            .collect()
    }
}

/// A drive.
#[derive(Debug, Clone)]
pub struct Drive {
    /// Every scan in order.
    pub scans: Vec<Scan>,
    /// Every frame in order.
    pub frames: Vec<Frame>,
    /// The world in the frame of the map.
    pub truth: Truth,
}

impl Drive {
    /// Drives through the world to the end of the way. Readings from `range_limit_m` on are no echo.
    #[must_use]
    pub fn through(world: &World, body: &Body, range_limit_m: f64, camera: Option<&CameraSetup>, seed: u64) -> Self {
        let mut simulation = Simulation::new(world, body, seed);
        let surfaces = simulation.surfaces();
        let mut scans = Vec::new();
        while let Some((packet, truth)) = simulation.next_packet() {
            let readings: Vec<SonarReading> = packet
                .readings
                .iter()
                .filter_map(|reading| {
                    Some(SonarReading {
                        mount: *body.ring().get(usize::from(reading.sonar))?,
                        range_m: reading.range_m.min(range_limit_m),
                        sonar: u32::from(reading.sonar),
                        echo: u32::from(reading.range_m < range_limit_m),
                    })
                })
                .collect();
            let scan = SonarScan::new(packet.odometry, &readings, false);
            scans.push(Scan { seq: packet.number, stamp_ns: packet.stamp_ns, scan, truth, placed: None });
        }
        let frames = camera.map(|setup| setup.frames(world, seed)).unwrap_or_default();
        let truth = Truth::new(&surfaces, &scans);
        Self { scans, frames, truth }
    }
}
