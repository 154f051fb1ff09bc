//! The estimate of the whole drive after a place was recognised, in slices, while the drive continues.

use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

use crate::graph::{Closure, Estimate, Graph, Model, NO_LINE, Solver, Span, anchor, closure_square, merge};
use crate::rigid::{Rigid, alignment};
use crate::runs::gate_m;

/// Graduated non-convexity: at first every closure counts, in the end a contradicted one has no weight.
const GRADUATED: [f64; 5] = [1e3, 1e2, 10.0, 3.0, 1.0];
/// Square of the error, in deviations, of a closure that contradicts nothing: one step is enough.
const GENTLE_SQUARE: f64 = 4.0;

/// A copy of the estimate, and how far it is adjusted.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, Schema)]
pub(crate) struct Adjustment {
    estimate: Estimate,
    /// Echoes of the graph when it began.
    echoes: u32,
    /// The steps that are left before the lines are merged, the last first.
    steps: Vec<f64>,
    /// For each line, the one that has its echoes, once the lines are merged.
    owners: Option<Vec<u32>>,
    /// Slices of work on the present step.
    slices: u32,
}

impl Adjustment {
    /// With new closures.
    pub(crate) fn begin(graph: &Graph, found: Vec<Closure>) -> Self {
        let mut estimate = graph.estimate.clone();
        let is_gentle = found.iter().all(|closure| closure_square(closure, &estimate.poses) < GENTLE_SQUARE);
        estimate.closures.extend(found);
        let steps = if is_gentle { vec![1.0] } else { GRADUATED.into_iter().rev().collect() };
        Self { estimate, echoes: graph.echoes.len() as u32, steps, owners: None, slices: 0 }
    }

    /// At the end of the drive: every step, whatever was found.
    pub(crate) fn last(graph: &Graph, found: Vec<Closure>) -> Self {
        Self { steps: GRADUATED.into_iter().rev().collect(), ..Self::begin(graph, found) }
    }

    /// A slice of about `products`; whether the estimate is adjusted. `solver` is what earlier slices of the step left.
    pub(crate) fn work(&mut self, graph: &Graph, model: &Model, solver: &mut Option<Solver>, products: usize) -> bool {
        self.slices = self.slices.saturating_add(1);
        let Some(mut present) = solver.take() else {
            *solver = self.steps.last().map(|mu| Solver::assemble(graph, &mut self.estimate, model, Span::Everything, *mu));
            return solver.is_none();
        };
        match present.work(products) {
            Ok(false) => {
                *solver = Some(present);
                return false;
            }
            Ok(true) => present.apply(graph, &mut self.estimate),
            // Numbers that cannot be solved leave the estimate as it is.
            Err(_) => {}
        }
        self.steps.pop();
        self.slices = 0;
        if self.steps.is_empty() && self.owners.is_none() {
            let gate = gate_m(self.estimate.deviation_m);
            self.owners = Some(merge(graph, &mut self.estimate, gate));
            self.steps.push(1.0);
        }
        self.steps.is_empty()
    }

    /// The solver as it was when the adjustment was saved.
    pub(crate) fn redo(&mut self, graph: &Graph, model: &Model, products: usize) -> Option<Solver> {
        let slices = std::mem::take(&mut self.slices);
        let mut solver = None;
        let step = self.steps.len();
        while self.slices < slices && self.steps.len() == step && !self.work(graph, model, &mut solver, products) {}
        solver
    }

    /// Whether its numbers name what the graph has.
    pub(crate) fn fits(&self, graph: &Graph) -> bool {
        let Self { estimate, echoes, owners, .. } = self;
        let lines = estimate.lines.len();
        let owned = owners.as_ref().is_none_or(|owners| owners.len() == lines && owners.iter().all(|owner| (*owner as usize) < lines));
        graph.holds(estimate, *echoes as usize) && lines <= graph.estimate.lines.len() && !estimate.poses.is_empty() && owned
    }

    /// Gives the adjusted estimate to the graph, laid rigidly on the present one: otherwise the map turns about its start. What
    /// was added since is carried along with the last node.
    pub(crate) fn finish(self, graph: &mut Graph) {
        let Self { estimate: mut adjusted, owners, echoes, .. } = self;
        let count = adjusted.poses.len();
        let places = |poses: &[Rigid]| poses[..count].iter().map(|pose| [pose.x, pose.y]).collect::<Vec<_>>();
        let motion = alignment(&places(&adjusted.poses), &places(&graph.estimate.poses));
        adjusted.moved(&motion);
        let Some((last, before)) = adjusted.poses.last().zip(graph.estimate.poses.get(count - 1)) else { return };
        let carried = last.then(&before.inverse());
        adjusted.poses.extend(graph.estimate.poses[count..].iter().map(|pose| carried.then(pose)));
        let owners = owners.unwrap_or_else(|| (0..adjusted.lines.len() as u32).collect());
        for (number, line) in graph.estimate.lines.iter().enumerate() {
            match owners.get(number) {
                Some(owner) => {
                    let owner = &mut adjusted.lines[*owner as usize];
                    owner.echoes.extend(line.echoes.iter().filter(|echo| **echo >= echoes));
                    owner.seen_m = owner.seen_m.max(line.seen_m);
                }
                None => {
                    let mut line = line.clone();
                    line.moved(&carried);
                    adjusted.lines.push(line);
                }
            }
        }
        for echo in graph.echoes.iter_mut().filter(|echo| echo.line != NO_LINE) {
            echo.line = owners.get(echo.line as usize).copied().unwrap_or(echo.line);
        }
        adjusted.deviation_m = graph.estimate.deviation_m;
        for line in 0..adjusted.lines.len() {
            adjusted.lines[line].echoes.sort_unstable();
            anchor(graph, &mut adjusted, line);
        }
        graph.estimate = adjusted;
    }
}
