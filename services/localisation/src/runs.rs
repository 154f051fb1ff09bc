//! From echoes to lines: each echo goes to a line that explains it, or to its sonar's run, and a run that one line explains becomes
//! a line.

use messages::SonarReading;
use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

use crate::fit::{Fit, fit};
use crate::graph::{Echo, Graph, Line, Model};
use crate::noise::Noise;
use crate::rigid::Rigid;

/// Ranges that a line may be fitted to, m: below, a Pioneer's sonar still rings; above, its echoes are as likely from aside.
const RANGES_M: [f64; 2] = [0.16, 2.99];
/// Echoes of one sonar that a node takes: more of them say the same.
const ECHOES_PER_NODE: u32 = 4;
/// How far past its ends a line explains echoes, m.
const BEYOND_ENDS_M: f64 = 1.0;
/// An echo belongs to a line when it is off by less, m, and by less than this multiple of the noise. With the first alone, noisy
/// sonars gave a map worse than odometry's (3.6 m).
const GATE_M: f64 = 0.10;
const GATE_DEVIATIONS: f64 = 5.0;
/// A line that was not seen for longer may be off by as much as the robot has drifted, m of path.
const ACTIVE_M: f64 = 5.0;
/// A run ends where the sonar moved farther between two echoes, m, or the range changed by more than it moved and this, m.
const RUN_STEP_M: f64 = 0.4;
const RUN_JUMP_M: f64 = 0.05;
/// Greatest root mean square and greatest residual of a run that is a wall, m, and as multiples of the noise.
const RUN_RMS: [f64; 2] = [0.02, 1.7];
const RUN_WORST: [f64; 2] = [0.045, 4.0];
/// Fewest echoes that are judged, fewest of a line, and the shortest base of a line, m.
const JUDGED_ECHOES: usize = 4;
const LINE_ECHOES: usize = 5;
const LINE_BASE_M: f64 = 0.35;

/// One sonar's echoes that no line explains yet.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, Schema)]
struct Run {
    echoes: Vec<u32>,
    /// The last three ranges, m; 0 where there was none.
    ranges: [f64; 3],
    /// Echoes in the present node.
    in_node: u32,
}

/// The runs of all sonars.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, Schema)]
pub(crate) struct Runs {
    sonars: Vec<Run>,
    noise: Noise,
}

/// Where a scan was taken.
#[derive(Debug, Clone, Copy)]
pub(crate) struct At {
    /// In the frame of the last node.
    pub(crate) node_from_robot: Rigid,
    /// The robot drove straight ahead since the last scan.
    pub(crate) is_driving: bool,
    /// Lines of any age explain echoes.
    pub(crate) knows_all_lines: bool,
}

/// Echoes farther than this from a line belong to something else, m.
pub(crate) fn gate_m(deviation_m: f64) -> f64 {
    GATE_M.max(GATE_DEVIATIONS * deviation_m)
}

impl Runs {
    /// A node begins: sonars may add echoes again.
    pub(crate) fn begin_node(&mut self, graph: &mut Graph) {
        self.sonars.iter_mut().for_each(|run| run.in_node = 0);
        graph.estimate.deviation_m = self.noise.deviation_m();
    }

    /// Whether every run names echoes of the graph.
    pub(crate) fn fits(&self, graph: &Graph) -> bool {
        self.sonars.iter().flat_map(|run| &run.echoes).all(|echo| (*echo as usize) < graph.echoes.len())
    }

    /// Takes a reading of the scan at `at`.
    pub(crate) fn add(&mut self, graph: &mut Graph, model: &Model, at: &At, reading: &SonarReading) {
        let number = reading.sonar as usize;
        if self.sonars.len() <= number {
            self.sonars.resize_with(number + 1, Run::default);
        }
        let Self { sonars, noise } = self;
        let Some(run) = sonars.get_mut(number) else { return };
        if reading.echo == 0 || !(RANGES_M[0]..=RANGES_M[1]).contains(&reading.range_m) {
            run.ranges = [0.0; 3];
            return;
        }
        run.ranges = [run.ranges[1], run.ranges[2], reading.range_m];
        if run.ranges[0] > 0.0 && at.is_driving {
            noise.add(run.ranges);
        }
        let Some(node) = graph.nodes.len().checked_sub(1).filter(|_| run.in_node < ECHOES_PER_NODE) else { return };
        run.in_node += 1;
        let echo = Echo::new(node as u32, &at.node_from_robot.then(&Rigid::of(&reading.mount)), reading.range_m);
        let number = graph.echoes.len();
        graph.echoes.push(echo);
        match explaining(graph, model, at, &echo) {
            Some(line) => attach(graph, line, number),
            None => run.extend(graph, model, number),
        }
    }
}

/// The line that explains an echo best.
fn explaining(graph: &Graph, model: &Model, at: &At, echo: &Echo) -> Option<usize> {
    let (sonar, path_m, gate) = (graph.sonar(echo), graph.path_m(echo.node as usize), gate_m(graph.estimate.deviation_m));
    let mut best: Option<(f64, usize)> = None;
    for (number, line) in graph.estimate.lines.iter().enumerate() {
        if !line.is_alive() || !(at.knows_all_lines || path_m - line.seen_m < ACTIVE_M) {
            continue;
        }
        let Some(error) = line.residual(&sonar, echo.range(), model.reach_rad(), BEYOND_ENDS_M) else { continue };
        if error.abs() < best.map_or(gate, |(least, _)| least) {
            best = Some((error.abs(), number));
        }
    }
    best.map(|(_, number)| number)
}

fn attach(graph: &mut Graph, line: usize, number: usize) {
    let echo = &mut graph.echoes[number];
    echo.line = line as u32;
    let echo = *echo;
    let (sonar, path_m) = (graph.sonar(&echo), graph.path_m(echo.node as usize));
    let line = &mut graph.estimate.lines[line];
    let [_, aside] = line.along([sonar.x, sonar.y]);
    line.ends = [line.ends[0].min(aside), line.ends[1].max(aside)];
    line.seen_m = line.seen_m.max(path_m);
    line.echoes.push(number as u32);
}

impl Run {
    /// Adds an echo, and makes a line of the run where one explains it.
    fn extend(&mut self, graph: &mut Graph, model: &Model, number: usize) {
        let echo = graph.echoes[number];
        let sonar = graph.sonar(&echo);
        if let Some(last) = self.echoes.last().map(|last| graph.echoes[*last as usize]) {
            let step = graph.sonar(&last).distance(&sonar);
            if step > RUN_STEP_M || (echo.range() - last.range()).abs() > step + RUN_JUMP_M {
                self.echoes.clear();
            }
        }
        self.echoes.push(number as u32);
        let mut found = None;
        while self.echoes.len() >= JUDGED_ECHOES {
            found = fit(graph, model, &self.echoes).filter(|fit| is_wall(fit, graph.estimate.deviation_m));
            if found.is_some() {
                break;
            }
            self.echoes.remove(0);
        }
        let Some(fit) = found else { return };
        let first = self.echoes.first().map(|first| graph.echoes[*first as usize]);
        let base = first.map_or(0.0, |first| graph.sonar(&first).distance(&sonar));
        if self.echoes.len() >= LINE_ECHOES && base >= LINE_BASE_M {
            let seen_m = graph.path_m(echo.node as usize);
            let ends = [f64::INFINITY, f64::NEG_INFINITY];
            let line = Line { normal: fit.normal, offset: fit.offset, anchor: fit.anchor, ends, echoes: Vec::new(), seen_m };
            graph.estimate.lines.push(line);
            let line = graph.estimate.lines.len() - 1;
            self.echoes.drain(..).for_each(|number| attach(graph, line, number as usize));
        }
    }
}

fn is_wall(fit: &Fit, deviation_m: f64) -> bool {
    let within = |[base, factor]: [f64; 2]| base.max(factor * deviation_m);
    fit.rms < within(RUN_RMS) && fit.worst < within(RUN_WORST)
}
