//! Replays in lockstep of one recorded drive.

use std::path::{Path, PathBuf};
use std::sync::LazyLock;

use super::recorded_drive::RecordedDrive;
use super::{Deployment, Sandbox, worlds};

/// The processes of [`replay`].
pub(crate) const PROCESSES: [&str; 5] = ["recorder", "mapping", "fti", "std", "playback"];

/// One recorded drive for all tests: among walkers, with STD and FTI but no camera.
pub(crate) static DRIVE: LazyLock<Drive> = LazyLock::new(|| {
    let drive = filtering(Deployment::new("drive", &["recorder", "mapping", "fti", "std", "simulator", "pioneer"]));
    let drive = drive.set("simulator.world", worlds::path("corridor")).set("pioneer.port", "simulator");
    let recorded = RecordedDrive::of(&drive, false);
    let sandbox = Sandbox::new();
    let map = sandbox.run(&replay("undisturbed", &recorded.write(&sandbox)), &[]).end().map();
    Drive { recorded, map, map_pgm: std::fs::read(sandbox.path("undisturbed-out").join("map.pgm")).unwrap() }
});

/// A recorded drive, and the hash of the map of its undisturbed replay.
pub(crate) struct Drive {
    recorded: RecordedDrive,
    pub(crate) map: String,
    /// The same map as a file.
    pub(crate) map_pgm: Vec<u8>,
}

impl Drive {
    /// The file of the log in a sandbox.
    pub(crate) fn log(&self, sandbox: &Sandbox) -> PathBuf {
        self.recorded.write(sandbox)
    }

    /// Its replay in a sandbox.
    pub(crate) fn replay(&self, sandbox: &Sandbox, name: &str) -> Deployment {
        replay(name, &self.log(sandbox))
    }
}

/// A deployment that replays a log in lockstep and records it again.
pub(crate) fn replay(name: &str, log: &Path) -> Deployment {
    let replay = filtering(Deployment::new(name, &PROCESSES)).set("pace", "lockstep");
    replay.set("playback.log", log).set("playback.window", 16).tireless().patient()
}

/// What a drive and its replays have in common.
fn filtering(deployment: Deployment) -> Deployment {
    let robot = deployment.set("robot.range_limit_m", 3.0).set("robot.odometry_modulus", 32768);
    robot.set("mapping.keep_unfiltered", true)
}
