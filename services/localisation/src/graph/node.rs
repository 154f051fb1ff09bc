//! The chain of poses and the odometry between them.

use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

use crate::rigid::{Rigid, length};

/// Odometry from one node to the next.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize, Schema)]
pub(crate) struct Step {
    /// As counted, before any correction.
    pub(crate) odometry: Rigid,
    /// The yaw of `odometry` is the camera's.
    pub(crate) by_camera: bool,
    /// The robot may have moved without its wheels.
    pub(crate) is_doubtful: bool,
}

/// A pose of the chain.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, Schema)]
pub(crate) struct Node {
    /// Number of the scan that it is the pose of.
    pub(crate) seq: u64,
    /// From the node before; for the first node, its odometry.
    pub(crate) step: Step,
    /// Path length up to here, m.
    pub(crate) path_m: f64,
    /// Its first echo.
    pub(crate) first_echo: u32,
}

/// Systematic errors of one source of headings.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize, Schema)]
pub(crate) struct HeadingErrors {
    /// Share of turns counted too much.
    pub(crate) turn: f64,
    /// Left turn counted too little on a straight path, rad per m.
    pub(crate) curvature: f64,
}

/// The odometry's systematic errors.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize, Schema)]
pub(crate) struct Calibration {
    /// Share of distances counted too much.
    pub(crate) distance: f64,
    pub(crate) wheels: HeadingErrors,
    pub(crate) camera: HeadingErrors,
}

impl Calibration {
    pub(crate) fn heading(&self, by_camera: bool) -> &HeadingErrors {
        if by_camera { &self.camera } else { &self.wheels }
    }

    /// The step that the robot made, by what is known of its odometry.
    pub(crate) fn corrected(&self, step: &Step) -> Rigid {
        let u = step.odometry;
        let heading = self.heading(step.by_camera);
        let share = 1.0 - self.distance;
        Rigid::new(u.x * share, u.y * share, u.yaw * (1.0 - heading.turn) - heading.curvature * length([u.x, u.y]))
    }
}
