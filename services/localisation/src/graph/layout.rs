//! Where the variables of a step stand, and the sonars at its echoes.

use std::ops::Range;

use super::{Echo, Estimate, Graph, Line};
use crate::rigid::{Rigid, unit};

/// Lines seen last this many nodes before a window still take part in it.
const SEEN_BEFORE_NODES: usize = 5;

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
    pub(super) fn new(graph: &Graph, estimate: &Estimate, span: Span) -> Self {
        let first = span.first();
        let count = estimate.poses.len();
        let last_node = |line: &Line| line.echoes.last().map(|echo| graph.echoes[*echo as usize].node as usize);
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
    pub(super) fn first_columns(&self, graph: &Graph, estimate: &Estimate) -> Vec<usize> {
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
    type Item = (&'a Echo, Rigid);

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
