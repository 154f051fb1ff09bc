//! Which poses were answered, and which of them a new estimate moves.

use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

use crate::answer::Moved;
use crate::graph::Graph;
use crate::rigid::{Rigid, wrap};

/// Smaller corrections are less than a cell of a map, m and rad (0.5°).
const LEAST_M: f64 = 0.02;
const LEAST_RAD: f64 = 0.008_727;

/// What was answered of a node.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, Schema)]
struct AnsweredNode {
    /// Number of its last scan that was answered.
    last: u64,
    /// Its pose in the answer to its first scan, or in the last revision that moved it.
    pose: Rigid,
}

/// The nodes of which scans were answered: the first of the graph.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, Schema)]
pub(crate) struct Answered(Vec<AnsweredNode>);

impl Answered {
    /// Notes that a scan of a node was answered, in the order of the scans; `pose` is that of the node.
    pub(crate) fn note(&mut self, node: u32, seq: u64, pose: Rigid) {
        match self.0.get_mut(node as usize) {
            Some(known) => known.last = seq,
            None => self.0.push(AnsweredNode { last: seq, pose }),
        }
    }

    /// The stretches that the present estimate moves, which are taken as answered.
    pub(crate) fn revise(&mut self, graph: &Graph) -> Vec<Moved> {
        let mut moved = Vec::new();
        for ((known, node), pose) in self.0.iter_mut().zip(&graph.nodes).zip(&graph.estimate.poses) {
            if known.pose.distance(pose) > LEAST_M || wrap(known.pose.yaw - pose.yaw).abs() > LEAST_RAD {
                moved.push(Moved { first: node.seq, last: known.last, before: (&known.pose).into(), now: pose.into() });
                known.pose = *pose;
            }
        }
        moved
    }
}
