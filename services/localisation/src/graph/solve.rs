//! One Gauss–Newton step over a part of the graph, in slices.

use std::ops::Range;

use super::factors;
use super::{Calibration, Estimate, Graph, Model};
use crate::envelope::{Envelope, Singular};
use crate::parameters::RightAngles;
use crate::rigid::{Rigid, unit};

/// Lines seen last this many nodes before a window still take part in it.
const SEEN_BEFORE_NODES: usize = 5;
/// A first wall of this length sets the building's direction, m.
const DIRECTION_FROM_M: f64 = 1.2;
/// Systematic errors beyond these are not a robot's: share of distances, share of turns, curvature (rad per m).
const CALIBRATION_LIMITS: [f64; 3] = [0.15, 0.15, 0.03];
/// Keeps the matrix positive where nothing was measured.
const DAMPING: f64 = 1e-6;

/// The part of the graph that a step estimates.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Span {
    /// The nodes from this one on. The calibration and the building's direction are held: a window sees too little of them.
    Window(usize),
    /// Every node but the first.
    Everything,
}

impl Span {
    pub(crate) fn first(self) -> usize {
        match self {
            Self::Window(first) => first.max(1),
            Self::Everything => 1,
        }
    }
}

/// Columns of the variables: nodes in time, each line behind the last node that saw it, then calibration and direction.
#[derive(Debug, Clone)]
pub(crate) struct Layout {
    first: usize,
    nodes: Vec<usize>,
    /// Lines that take part, with their columns.
    pub(super) lines: Vec<(usize, usize)>,
    /// Distance, then turn and curvature of wheels and camera.
    pub(super) calibration: usize,
    pub(super) direction: usize,
}

/// Numbers of the calibration.
pub(super) const CALIBRATION: usize = 5;

impl Layout {
    fn new(graph: &Graph, estimate: &Estimate, span: Span) -> Self {
        let first = span.first();
        let count = estimate.poses.len();
        let last_node = |line: &super::Line| line.echoes.last().map(|echo| graph.echoes[*echo as usize].node as usize);
        let mut waiting: Vec<(usize, usize)> = (0..)
            .zip(&estimate.lines)
            .filter_map(|(number, line)| Some((last_node(line)?, number)))
            .filter(|(last, _)| span == Span::Everything || last + SEEN_BEFORE_NODES >= first)
            .collect();
        waiting.sort_unstable();
        let mut waiting = waiting.into_iter().peekable();
        let (mut nodes, mut lines, mut column) = (Vec::new(), Vec::new(), 0);
        for node in first..count {
            nodes.push(column);
            column += 3;
            while let Some((_, line)) = waiting.next_if(|(last, _)| *last <= node) {
                lines.push((line, column));
                column += 2;
            }
        }
        Self { first, nodes, lines, calibration: column, direction: column + CALIBRATION }
    }

    /// Column of a node; `None` for one that is fixed.
    pub(super) fn node(&self, node: usize) -> Option<usize> {
        self.nodes.get(node.checked_sub(self.first)?).copied()
    }

    pub(super) fn estimated_nodes(&self) -> Range<usize> {
        self.first..self.first + self.nodes.len()
    }

    /// Where the rows begin.
    fn first_columns(&self, graph: &Graph, estimate: &Estimate) -> Vec<usize> {
        let mut first: Vec<usize> = (0..=self.direction).collect();
        let mut reach = |rows: Range<usize>, column: usize| rows.for_each(|row| first[row] = first[row].min(column));
        for (k, &column) in self.nodes.iter().enumerate() {
            reach(column..column + 3, self.nodes[k.saturating_sub(1)]);
        }
        for &(line, column) in &self.lines {
            let seen = estimate.lines[line].echoes.first().map_or(self.first, |echo| graph.echoes[*echo as usize].node as usize);
            reach(column..column + 2, self.node(seen.max(self.first)).unwrap_or(column));
        }
        for closure in &estimate.closures {
            if let (Some(earlier), Some(later)) = (self.node(closure.earlier as usize), self.node(closure.later as usize)) {
                reach(later..later + 3, earlier);
            }
        }
        reach(self.calibration..self.direction + 1, 0);
        first
    }
}

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

/// The sonars at echoes in the map frame, one after the other; consecutive echoes of a node share its sine.
pub(super) struct Sonars<'a> {
    graph: &'a Graph,
    poses: &'a [Rigid],
    echoes: std::slice::Iter<'a, u32>,
    node: u32,
    axes: [f64; 2],
}

impl<'a> Sonars<'a> {
    pub(super) fn new(graph: &'a Graph, poses: &'a [Rigid], echoes: &'a [u32]) -> Self {
        Self { graph, poses, echoes: echoes.iter(), node: u32::MAX, axes: [1.0, 0.0] }
    }
}

impl<'a> Iterator for Sonars<'a> {
    type Item = (&'a super::Echo, Rigid);

    fn next(&mut self) -> Option<Self::Item> {
        let echo = &self.graph.echoes[*self.echoes.next()? as usize];
        let pose = &self.poses[echo.node as usize];
        if echo.node != self.node {
            self.node = echo.node;
            self.axes = unit(pose.yaw);
        }
        let ([cos, sin], mount) = (self.axes, echo.mount());
        Some((echo, Rigid::new(pose.x + cos * mount.x - sin * mount.y, pose.y + sin * mount.x + cos * mount.y, pose.yaw + mount.yaw)))
    }
}
