//! One Gauss–Newton step over a part of the graph, in slices.

use super::factors;
use super::layout::{Layout, Sonars, Span};
use super::{Calibration, Estimate, Graph, Model};
use crate::envelope::{Envelope, Singular};
use crate::parameters::RightAngles;
use crate::rigid::Rigid;

/// A first wall of this length sets the building's direction, m.
const DIRECTION_FROM_M: f64 = 1.2;
/// Systematic errors beyond these are not a robot's: share of distances, share of turns, curvature (rad per m).
const CALIBRATION_LIMITS: [f64; 3] = [0.15, 0.15, 0.03];
/// Keeps the matrix positive where nothing was measured.
const DAMPING: f64 = 1e-6;

/// A step that is being computed.
#[derive(Debug, Clone)]
pub(crate) struct Solver {
    layout: Layout,
    envelope: Envelope,
}

impl Solver {
    /// The normal equations at the present estimate. `mu` is the scale μ of graduated non-convexity for closures: they
    /// all count at large values, and a contradicted one has no weight at 1.
    pub(crate) fn assemble(graph: &Graph, estimate: &mut Estimate, model: &Model, span: Span, mu: f64) -> Self {
        let layout = Layout::new(graph, estimate, span);
        if model.right_angles != RightAngles::Off && estimate.direction.is_none() {
            let long = |(line, _): &&(usize, usize)| estimate.lines[*line].length() > DIRECTION_FROM_M;
            estimate.direction = layout.lines.iter().filter(long).min().map(|(line, _)| estimate.lines[*line].normal);
        }
        let mut envelope = Envelope::new(layout.first_columns(graph, estimate));
        factors::odometry(&mut envelope, &layout, graph, estimate);
        factors::priors(&mut envelope, &layout, estimate, span);
        factors::walls(&mut envelope, &layout, graph, estimate, model);
        factors::closures(&mut envelope, &layout, estimate, mu);
        envelope.damp(DAMPING);
        Self { layout, envelope }
    }

    /// Works for about as many products; whether the step is computed.
    pub(crate) fn work(&mut self, products: usize) -> Result<bool, Singular> {
        self.envelope.eliminate(products)
    }

    /// Makes the step.
    pub(crate) fn apply(self, graph: &Graph, estimate: &mut Estimate) {
        let x = self.envelope.solve();
        for node in self.layout.estimated_nodes() {
            if let (Some(column), Some(pose)) = (self.layout.node(node), estimate.poses.get_mut(node)) {
                *pose = Rigid::new(pose.x + x[column], pose.y + x[column + 1], pose.yaw + x[column + 2]);
            }
        }
        apply_calibration(&mut estimate.calibration, &x[self.layout.calibration..self.layout.direction]);
        if let Some(direction) = &mut estimate.direction {
            *direction += x[self.layout.direction];
        }
        for &(line, column) in &self.layout.lines {
            estimate.lines[line].normal += x[column];
            estimate.lines[line].offset += x[column + 1];
            anchor(graph, estimate, line);
        }
    }
}

fn apply_calibration(calibration: &mut Calibration, steps: &[f64]) {
    let Calibration { distance, wheels, camera } = calibration;
    let numbers = [distance, &mut wheels.turn, &mut wheels.curvature, &mut camera.turn, &mut camera.curvature];
    let [shares, turns, curvature] = CALIBRATION_LIMITS;
    for ((number, step), limit) in numbers.into_iter().zip(steps).zip([shares, turns, curvature, turns, curvature]) {
        *number = (*number + step).clamp(-limit, limit);
    }
}

/// Sets the anchor of a line by the present poses.
pub(crate) fn anchor(graph: &Graph, estimate: &mut Estimate, line: usize) {
    let sonars: Vec<[f64; 2]> =
        Sonars::new(graph, &estimate.poses, &estimate.lines[line].echoes).map(|(_, sonar)| [sonar.x, sonar.y]).collect();
    estimate.lines[line].set_anchor(&sonars);
}
