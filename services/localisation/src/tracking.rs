//! The estimate, scan by scan.

use messages::SonarScan;
use postcard_schema::Schema;
use postcard_schema::schema::{DataModelType, NamedType};
use serde::{Deserialize, Serialize};

use crate::adjustment::Adjustment;
use crate::answer::Moved;
use crate::closure::{Search, SearchWork};
use crate::graph::{Graph, Model, Solver, Span, Step};
use crate::revision::Answered;
use crate::rigid::{Rigid, length};
use crate::runs::{At, Runs};

/// A new node after so much odometry, m and rad (6°).
const NODE_M: f64 = 0.15;
const NODE_RAD: f64 = 0.1047;
/// Nodes between two steps of the solver, and nodes that a step estimates: 9 m of path, which see a wall whole.
const STEP_NODES: u32 = 3;
const WINDOW_NODES: usize = 60;
/// Path between two searches for an earlier visit, m.
const SEARCH_M: f64 = 2.5;
/// A closure of this weight makes old lines known again for so much path, m.
const ACCEPTED_WEIGHT: f64 = 0.3;
const KNOWN_AGAIN_M: f64 = 3.0;
/// A sonar's ranges tell its noise where the robot moves by at least this from scan to scan, m.
const DRIVING_M: f64 = 1e-3;
/// Look-ups of a search and products of a solver in one slice: about 1 ms on one core of a server of 2023.
const LOOK_UPS: usize = 400_000;
const PRODUCTS: usize = 1_000_000;

/// What is being computed beside the scans, a slice a scan.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, Schema)]
enum Job {
    Search(Search),
    Adjustment(Adjustment),
}

/// What slices have computed; it follows from the job.
#[derive(Debug, Clone, Default)]
struct Work {
    search: SearchWork,
    solver: Option<Solver>,
}

/// It is not part of a state.
impl Schema for Work {
    const SCHEMA: &'static NamedType = &NamedType { name: "Work", ty: &DataModelType::Unit };
}

/// The estimate and everything that it is continued from.
#[derive(Debug, Clone, Default, Serialize, Deserialize, Schema)]
pub(crate) struct Tracking {
    pub(crate) graph: Graph,
    runs: Runs,
    /// Odometry of the last node, and of the last scan.
    node_odometry: Rigid,
    scan_odometry: Rigid,
    unsolved_nodes: u32,
    searched_m: f64,
    known_until_m: f64,
    job: Option<Job>,
    pub(crate) answered: Answered,
    #[serde(skip)]
    work: Work,
}

/// Where a scan was taken: its node, and the pose in the node's frame.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, Schema)]
pub(crate) struct Placed {
    pub(crate) node: u32,
    pub(crate) node_from_robot: Rigid,
}

impl Tracking {
    /// Takes a scan; what a recognised place moved.
    pub(crate) fn step(&mut self, model: &Model, seq: u64, scan: &SonarScan) -> (Placed, Option<Vec<Moved>>) {
        let odometry = Rigid::of(&scan.pose);
        self.add_node(seq, &odometry, scan.is_doubtful());
        let step = self.node_odometry.to(&odometry);
        let placed = Placed {
            node: self.graph.nodes.len().saturating_sub(1) as u32,
            node_from_robot: self.graph.estimate.calibration.corrected(&Step { odometry: step, ..Step::default() }),
        };
        let path_m = self.path_m();
        let is_driving = self.scan_odometry.distance(&odometry) > DRIVING_M;
        let at = At { node_from_robot: placed.node_from_robot, is_driving, knows_all_lines: path_m < self.known_until_m };
        self.scan_odometry = odometry;
        for reading in scan.readings() {
            self.runs.add(&mut self.graph, model, &at, reading);
        }
        if self.unsolved_nodes >= STEP_NODES {
            self.unsolved_nodes = 0;
            self.solve_window(model);
            self.begin_job(path_m);
        }
        let is_adjusted = self.work(model, [LOOK_UPS, PRODUCTS]);
        (placed, is_adjusted.then(|| self.answered.revise(&self.graph)))
    }

    /// The estimate of the whole drive, when there are no more scans.
    pub(crate) fn finish(&mut self, model: &Model) -> Vec<Moved> {
        while self.job.is_some() {
            self.work(model, [usize::MAX; 2]);
        }
        let mut found = Vec::new();
        if let Some(mut search) = Search::begin(&self.graph) {
            let mut work = SearchWork::default();
            found = loop {
                if let Some(found) = search.work(&mut work, usize::MAX) {
                    break found;
                }
            };
        }
        if !self.graph.nodes.is_empty() {
            self.job = Some(Job::Adjustment(Adjustment::last(&self.graph, found)));
        }
        while self.job.is_some() {
            self.work(model, [usize::MAX; 2]);
        }
        self.answered.revise(&self.graph)
    }

    /// The robot at a scan, in the map frame.
    pub(crate) fn pose(&self, placed: &Placed) -> Rigid {
        self.graph.estimate.poses.get(placed.node as usize).map_or(placed.node_from_robot, |pose| pose.then(&placed.node_from_robot))
    }

    /// Path length, m.
    fn path_m(&self) -> f64 {
        self.graph.nodes.last().map_or(0.0, |node| node.path_m)
    }

    fn add_node(&mut self, seq: u64, odometry: &Rigid, is_doubtful: bool) {
        let u = self.node_odometry.to(odometry);
        let step = if self.graph.nodes.is_empty() {
            Step { odometry: *odometry, ..Step::default() }
        } else if length([u.x, u.y]) >= NODE_M || u.yaw.abs() >= NODE_RAD || is_doubtful {
            Step { odometry: u, by_camera: false, is_doubtful }
        } else {
            return;
        };
        self.node_odometry = *odometry;
        self.unsolved_nodes += u32::from(!self.graph.nodes.is_empty());
        self.runs.begin_node(&mut self.graph);
        self.graph.add_node(seq, step);
    }

    fn solve_window(&mut self, model: &Model) {
        let window = match self.graph.nodes.len().saturating_sub(WINDOW_NODES) {
            0 => Span::Everything,
            first => Span::Window(first),
        };
        let mut estimate = std::mem::take(&mut self.graph.estimate);
        let mut solver = Solver::assemble(&self.graph, &mut estimate, model, window, 1.0);
        // Numbers that cannot be solved leave the estimate as it is.
        if solver.work(usize::MAX) == Ok(true) {
            solver.apply(&self.graph, &mut estimate);
        }
        self.graph.estimate = estimate;
    }

    fn begin_job(&mut self, path_m: f64) {
        if self.job.is_none() && path_m - self.searched_m >= SEARCH_M {
            self.searched_m = path_m;
            self.job = Search::begin(&self.graph).map(Job::Search);
        }
    }

    /// A slice of the job; whether the estimate of the whole drive has changed.
    fn work(&mut self, model: &Model, [look_ups, products]: [usize; 2]) -> bool {
        match &mut self.job {
            None => false,
            Some(Job::Search(search)) => {
                if let Some(found) = search.work(&mut self.work.search, look_ups) {
                    let is_new = !found.is_empty();
                    self.job = is_new.then(|| Job::Adjustment(Adjustment::begin(&self.graph, found)));
                }
                false
            }
            Some(Job::Adjustment(adjustment)) => {
                let is_done = adjustment.work(&self.graph, model, &mut self.work.solver, products);
                if is_done && let Some(Job::Adjustment(adjustment)) = self.job.take() {
                    self.work.solver = None;
                    adjustment.finish(&mut self.graph);
                    if self.graph.estimate.closures.last().is_some_and(|closure| closure.weight > ACCEPTED_WEIGHT) {
                        self.known_until_m = self.path_m() + KNOWN_AGAIN_M;
                    }
                }
                is_done
            }
        }
    }

    /// Whether everything that a saved state names is there.
    pub(crate) fn is_consistent(&self) -> bool {
        let of_job = match &self.job {
            None => true,
            Some(Job::Search(search)) => search.fits(self.graph.nodes.len()),
            Some(Job::Adjustment(adjustment)) => adjustment.fits(&self.graph),
        };
        self.graph.is_consistent() && self.runs.fits(&self.graph) && of_job
    }

    /// Computes again what slices of the job had computed when it was saved.
    pub(crate) fn redo(&mut self, model: &Model) {
        match &mut self.job {
            None => {}
            Some(Job::Search(search)) => self.work.search = search.redo(LOOK_UPS),
            Some(Job::Adjustment(adjustment)) => self.work.solver = adjustment.redo(&self.graph, model, PRODUCTS),
        }
    }
}
