//! The search for places where the robot was before.

use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

use super::Point;
use super::correlation::{Correlation, Region};
use crate::graph::{Closure, Graph, NO_LINE};
use crate::rigid::{Rigid, unit};

/// Path of the query, and to either side of a reference, m: shorter stretches of corridor look alike.
const STRETCH_M: f64 = 5.0;
/// A stretch is only an earlier visit if it is older, m of path.
const AGE_M: f64 = 10.0;
/// How far off the present estimate may be after some path, m: base, per metre, at most.
const REACH_M: [f64; 3] = [0.6, 0.03, 2.5];
/// The same of the heading, rad: 2°, 0.12° per metre, 10°.
const TURN_RAD: [f64; 3] = [0.0349, 0.002_09, 0.1745];
/// A reference may lie farther than the estimate is off: stretches overlap, m.
const ASIDE_M: f64 = 1.0;
/// References at most, and their distance along the path, m.
const REFERENCES: usize = 2;
const APART_M: f64 = 6.0;
/// Share of the query on the reference from which the place is recognised.
const LEAST_SCORE: f64 = 0.5;
/// Weight of an echo that no line explains: its direction is known to half a beam.
const LOOSE_WEIGHT: f32 = 0.35;

/// No stretch of path reaches farther with its echoes, m: what a damaged state claims beyond would take all memory.
const FARTHEST_M: f32 = 50.0;

/// A search: everything that it works on.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, Schema)]
pub(crate) struct Search {
    /// The middle of the query.
    node: u32,
    query: Vec<Point>,
    /// The references with their nodes; the first is being searched.
    regions: Vec<(u32, Region)>,
    /// Slices of work on the first.
    slices: u32,
    found: Vec<Closure>,
}

/// What a search has computed so far of its present region.
pub(crate) type SearchWork = Correlation;

impl Search {
    /// About the last metres of the path; `None` where there is nothing to compare them with.
    pub(crate) fn begin(graph: &Graph) -> Option<Self> {
        let path_m = graph.nodes.last()?.path_m;
        let node = graph.nodes.iter().position(|node| node.path_m > path_m - 0.5 * STRETCH_M)?;
        let base = graph.estimate.poses[node];
        let mut near: Vec<(f64, usize)> = Vec::new();
        for (number, pose) in graph.estimate.poses[..node].iter().enumerate() {
            let age = graph.path_m(node) - graph.path_m(number);
            let distance = pose.distance(&base);
            if age >= AGE_M && distance < grown(REACH_M, age) + ASIDE_M {
                near.push((distance, number));
            }
        }
        near.sort_by(|one, other| one.0.total_cmp(&other.0).then(one.1.cmp(&other.1)));
        let mut chosen: Vec<usize> = Vec::new();
        for (_, number) in near {
            if chosen.iter().all(|other| (graph.path_m(*other) - graph.path_m(number)).abs() > APART_M) {
                chosen.push(number);
            }
            if chosen.len() == REFERENCES {
                break;
            }
        }
        let query = points(graph, [path_m - STRETCH_M, path_m], &base);
        let region = |number: usize| {
            let (at_m, reference) = (graph.path_m(number), graph.estimate.poses[number]);
            let age = path_m - at_m;
            let points = points(graph, [at_m - STRETCH_M, at_m + STRETCH_M], &reference);
            (number as u32, Region { points, guess: reference.to(&base), reach: [grown(REACH_M, age), grown(TURN_RAD, age)] })
        };
        let regions: Vec<(u32, Region)> = chosen.into_iter().map(region).collect();
        (!regions.is_empty()).then(|| Self { node: node as u32, query, regions, slices: 0, found: Vec::new() })
    }

    /// A slice of about `products` look-ups; the closures found, when the search is over.
    pub(crate) fn work(&mut self, work: &mut SearchWork, products: usize) -> Option<Vec<Closure>> {
        let Some((_, region)) = self.regions.first() else { return Some(std::mem::take(&mut self.found)) };
        self.slices = self.slices.saturating_add(1);
        if work.work(&self.query, region, products) {
            let (earlier, _) = self.regions.remove(0);
            let hit = work.hit(&self.query).filter(|hit| hit.score >= LEAST_SCORE);
            self.found.extend(hit.map(|hit| Closure {
                earlier,
                later: self.node,
                relative: hit.pose,
                information: hit.information,
                weight: 1.0,
            }));
            self.slices = 0;
            *work = SearchWork::default();
        }
        None
    }

    /// What [`Self::work`] had computed when the search was saved.
    pub(crate) fn redo(&self, products: usize) -> SearchWork {
        let mut work = SearchWork::default();
        if let Some((_, region)) = self.regions.first() {
            let _ = (0..self.slices).any(|_| work.work(&self.query, region, products));
        }
        work
    }

    /// Whether its nodes are those of a graph with so many.
    pub(crate) fn fits(&self, nodes: usize) -> bool {
        let named = self.regions.iter().map(|region| region.0).chain(self.found.iter().flat_map(|it| [it.earlier, it.later]));
        let mut points = self.regions.iter().flat_map(|(_, region)| &region.points).chain(&self.query);
        let is_near = |point: &Point| point.x.abs() < FARTHEST_M && point.y.abs() < FARTHEST_M;
        named.chain([self.node]).all(|node| (node as usize) < nodes) && points.all(is_near)
    }
}

fn grown([base, per_m, most]: [f64; 3], age_m: f64) -> f64 {
    (base + per_m * age_m).min(most)
}

/// The echoes of a stretch of the path, in the frame of `base`: each where its line's normal meets the wall, or at the end of its axis.
fn points(graph: &Graph, [from_m, to_m]: [f64; 2], base: &Rigid) -> Vec<Point> {
    let nodes = graph.nodes.partition_point(|node| node.path_m < from_m)..graph.nodes.partition_point(|node| node.path_m <= to_m);
    let first = |node: usize| graph.nodes.get(node).map_or(graph.echoes.len(), |node| node.first_echo as usize);
    let inverse = base.inverse();
    let point = |echo: &crate::graph::Echo| {
        let sonar = graph.sonar(echo);
        let line = if echo.line == NO_LINE { None } else { graph.estimate.lines.get(echo.line as usize) };
        let (facing, weight) = line.map_or((sonar.yaw, LOOSE_WEIGHT), |line| (line.normal, 1.0));
        let [cos, sin] = unit(facing);
        let [x, y] = inverse.apply([sonar.x + cos * echo.range(), sonar.y + sin * echo.range()]);
        Point { x: x as f32, y: y as f32, facing: crate::rigid::wrap(facing - base.yaw) as f32, weight }
    };
    graph.echoes[first(nodes.start)..first(nodes.end)].iter().map(point).collect()
}
