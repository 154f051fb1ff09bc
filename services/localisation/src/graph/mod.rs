//! The graph: a chain of poses, the walls that their echoes came from, and the odometry's systematic errors.
//!
//! What was measured is in [`Graph`] and only grows; what is estimated from it is in [`Estimate`], of which a solver over the whole
//! drive takes a copy.

mod factors;
mod layout;
mod line;
mod merge;
mod node;
mod solve;

pub(crate) use factors::{closure_square, is_confirmed};
pub(crate) use layout::Span;
pub(crate) use line::{Echo, Line, NO_LINE};
pub(crate) use merge::merge;
pub(crate) use node::{Calibration, Node, Step};
pub(crate) use solve::{Solver, anchor};

use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

use crate::parameters::RightAngles;
use crate::rigid::{Rigid, length};

/// A pose of the chain that another pose saw again: the later in the frame of the earlier.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, Schema)]
pub(crate) struct Closure {
    pub(crate) earlier: u32,
    pub(crate) later: u32,
    pub(crate) relative: Rigid,
    /// Inverse covariance of x, y and yaw.
    pub(crate) information: [[f64; 3]; 3],
    /// Weight after the last step of a solver, 0 to 1.
    pub(crate) weight: f64,
}

/// What is estimated.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, Schema)]
pub(crate) struct Estimate {
    /// The robot at each node, in the map frame.
    pub(crate) poses: Vec<Rigid>,
    pub(crate) lines: Vec<Line>,
    pub(crate) closures: Vec<Closure>,
    pub(crate) calibration: Calibration,
    /// The building's direction modulo a right angle, once a long wall has set it.
    pub(crate) direction: Option<f64>,
    /// Standard deviation of a range, m.
    pub(crate) deviation_m: f64,
}

impl Estimate {
    /// Moves everything with the frame.
    pub(crate) fn moved(&mut self, motion: &Rigid) {
        self.poses.iter_mut().for_each(|pose| *pose = motion.then(pose));
        self.lines.iter_mut().for_each(|line| line.moved(motion));
        self.direction = self.direction.map(|direction| direction + motion.yaw);
    }
}

/// What was measured, and the present estimate.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, Schema)]
pub(crate) struct Graph {
    pub(crate) nodes: Vec<Node>,
    pub(crate) echoes: Vec<Echo>,
    pub(crate) estimate: Estimate,
}

/// What stays the same over a drive.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Model {
    pub(crate) right_angles: RightAngles,
    pub(crate) half_beam_rad: f64,
}

/// An echo off a smooth wall may come from a little beyond the nominal beam, rad: 5°.
const BEYOND_BEAM_RAD: f64 = 0.0873;

impl Model {
    /// Greatest angle between a sonar's axis and a wall's normal.
    pub(crate) fn reach_rad(&self) -> f64 {
        self.half_beam_rad + BEYOND_BEAM_RAD
    }
}

impl Graph {
    /// The sonar at an echo, in the map frame.
    pub(crate) fn sonar(&self, echo: &Echo) -> Rigid {
        self.estimate.poses[echo.node as usize].then(&echo.mount())
    }

    /// Whether an estimate over the first `echoes` of this graph names nothing that there is not.
    pub(crate) fn holds(&self, estimate: &Estimate, echoes: usize) -> bool {
        let nodes = estimate.poses.len();
        let in_lines = estimate.lines.iter().flat_map(|line| &line.echoes).all(|echo| {
            let echo = self.echoes[..echoes.min(self.echoes.len())].get(*echo as usize);
            echo.is_some_and(|echo| (echo.node as usize) < nodes)
        });
        let in_closures = estimate.closures.iter().all(|it| it.earlier < it.later && (it.later as usize) < nodes);
        nodes <= self.nodes.len() && in_lines && in_closures
    }

    /// Whether everything that it names is there, in order.
    pub(crate) fn is_consistent(&self) -> bool {
        let (nodes, lines, echoes) = (self.nodes.len(), self.estimate.lines.len(), self.echoes.len());
        let ordered = self.nodes.is_sorted_by(|one, next| one.first_echo <= next.first_echo && one.path_m <= next.path_m);
        let first = self.nodes.iter().all(|node| node.first_echo as usize <= echoes);
        let named = self.echoes.iter().all(|echo| (echo.node as usize) < nodes && (echo.line == NO_LINE || (echo.line as usize) < lines));
        self.estimate.poses.len() == nodes && ordered && first && named && self.holds(&self.estimate, echoes)
    }

    /// Path length up to a node, m.
    pub(crate) fn path_m(&self, node: usize) -> f64 {
        self.nodes.get(node).map_or(0.0, |node| node.path_m)
    }

    /// Adds a node whose odometry from the last node is `step`.
    pub(crate) fn add_node(&mut self, seq: u64, step: Step) {
        let (path_m, pose) = match (self.nodes.last(), self.estimate.poses.last()) {
            (Some(last), Some(pose)) => {
                (last.path_m + length([step.odometry.x, step.odometry.y]), pose.then(&self.estimate.calibration.corrected(&step)))
            }
            _ => (0.0, step.odometry),
        };
        self.nodes.push(Node { seq, step, path_m, first_echo: self.echoes.len() as u32 });
        self.estimate.poses.push(pose);
    }
}
