//! A drive through a simulated world, recorded: what every sense said, and the truth behind it.

use messages::{CameraMotion, SonarReading, SonarScan};
use simulator::blobs::{Blobs, Failings};
use simulator::{Body, Optics, Simulation, World};

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

/// The camera and its failings.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Eyes {
    /// As the robot takes the camera to be.
    pub optics: Optics,
    /// What goes wrong.
    pub failings: Failings,
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
    pub fn through(world: &World, body: &Body, range_limit_m: f64, eyes: Option<&Eyes>, seed: u64) -> Self {
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
            scans.push(Scan { seq: packet.number, stamp_ns: packet.stamp_ns, scan, truth });
        }
        let mut frames = Vec::new();
        if let Some(eyes) = eyes {
            let mut blobs = Blobs::new(world, &eyes.optics, &eyes.failings, seed);
            while let Some((stamp_ns, motion)) = blobs.next_frame() {
                frames.push(Frame { stamp_ns, motion });
            }
        }
        let truth = Truth::new(&surfaces, &scans);
        Self { scans, frames, truth }
    }
}
