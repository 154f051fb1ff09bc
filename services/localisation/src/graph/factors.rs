//! The residuals of the graph and their derivatives.

use super::layout::{Layout, Sonars, Span};
use super::{Closure, Estimate, Graph, Line, Model};
use crate::envelope::Envelope;
use crate::parameters::RightAngles;
use crate::rigid::{Rigid, along, length, unit, wrap, wrap_square};

/// Standard deviations of odometry per square root of a metre, beside its systematic errors: along the path (m), across it (m; a
/// differential drive does not slip sideways, and without this walls bend), and of its heading, which wanders by degrees on carpet.
const ALONG_M: f64 = 0.02;
const ACROSS_M: f64 = 0.005;
const WANDER_RAD: f64 = 0.0436;
/// Deviation of a turn, as a share of it.
const TURN_SHARE: f64 = 0.02;
/// The same of the camera's heading: .55 to .8 °/√m were measured in five worlds, and 1 % of turns.
const CAMERA_WANDER_RAD: f64 = 0.0105;
const CAMERA_TURN_SHARE: f64 = 0.01;
/// Variances of any step: (1 mm)² and (0.03°)².
const LEAST_M2: f64 = 1e-6;
const LEAST_RAD2: f64 = 2.5e-7;
/// Variance of a step that the robot may not have made by its wheels, m² and rad².
const DOUBT: f64 = 4.0;

/// Deviations of the systematic errors before anything was measured: distance (share), then turn (share) and curvature (rad per m)
/// of wheels and camera. Robots out of calibration are off by some per cent.
const PRIORS: [f64; 5] = [0.03, 0.05, 0.005_24, 0.05, 0.008_73];
/// A window holds what the whole drive has learnt: weight of its priors. With 10 000 the first nine metres decide the calibration
/// of the next fifty (.066 and .233 m at the commit on block and rooms, ten seeds); with this weight it is .047 and .137 m.
const HELD: f64 = 200.0;

/// Deviation of a wall's range, m: base and share of the range; and at least this multiple of the measured noise.
const RANGE_M: f64 = 0.012;
const RANGE_SHARE: f64 = 0.006;
const NOISE_FACTOR: f64 = 1.3;
/// Residuals beyond this many deviations lose weight (Cauchy).
const CAUCHY: f64 = 2.0;
/// An echo farther outside the beam than when it was accepted no longer counts, rad.
const TURNED_AWAY_RAD: f64 = 0.04;
/// A wall counts fully from this length on, m; if it agrees with the building's direction within 4°, from the second on.
/// Door jambs seen by oblique sonars look like short walls: with full weight they bias distances by 2 %.
const CONFIRMED_M: f64 = 1.0;
const CONFIRMED_SQUARE_M: f64 = 0.4;
const SQUARE_RAD: f64 = 0.07;
/// Weight of other walls. Over ten seeds, crossing and block end at .082 and .027 m with 0.05, at .065 and .033 m with 0.02.
const SHORT_WEIGHT: f64 = 0.03;
/// Deviation of a wall's normal from the axis of the sonar that saw it, rad: 8°.
const AXIS_RAD: f64 = 0.14;

/// Walls of at least this length, within this angle of the building's direction, are taken to be square with it: m and rad.
const RIGHT_ANGLE_FROM_M: f64 = 0.4;
const RIGHT_ANGLE_GATE_RAD: f64 = 0.209;
/// Deviation of such a wall, rad: 0.7°; and the error at which the prior has a quarter of its weight, rad.
const RIGHT_ANGLE_RAD: f64 = 0.0122;
const RIGHT_ANGLE_SCALE_RAD: f64 = 0.0428;

/// Square of the error, in deviations, at which a closure has a quarter of its weight (Geman–McClure).
const CLOSURE_SCALE: f64 = 9.0;

/// Deviation of a range off a wall, m.
pub(crate) fn range_deviation(range: f64, noise: f64) -> f64 {
    (RANGE_M + RANGE_SHARE * range).max(NOISE_FACTOR * noise)
}

/// The relative pose's derivatives by both poses, for residuals in the first one's frame.
fn relative(columns: [Option<usize>; 2], [cos, sin]: [f64; 2], [ahead, aside]: [f64; 2]) -> [Vec<(usize, f64)>; 3] {
    let mut rows = [Vec::with_capacity(9), Vec::with_capacity(9), Vec::with_capacity(9)];
    if let Some(j) = columns[1] {
        rows[0].extend([(j, cos), (j + 1, sin)]);
        rows[1].extend([(j, -sin), (j + 1, cos)]);
        rows[2].push((j + 2, 1.0));
    }
    if let Some(i) = columns[0] {
        rows[0].extend([(i, -cos), (i + 1, -sin), (i + 2, aside)]);
        rows[1].extend([(i, sin), (i + 1, -cos), (i + 2, -ahead)]);
        rows[2].push((i + 2, -1.0));
    }
    rows
}

pub(super) fn odometry(envelope: &mut Envelope, layout: &Layout, graph: &Graph, estimate: &Estimate) {
    for node in layout.estimated_nodes() {
        let (before, now) = (estimate.poses[node - 1], estimate.poses[node]);
        let step = graph.nodes[node].step;
        let u = step.odometry;
        let path = length([u.x, u.y]);
        let doubt = if step.is_doubtful { DOUBT } else { 0.0 };
        let (wander, share, errors) = if step.by_camera { (CAMERA_WANDER_RAD, CAMERA_TURN_SHARE, 3) } else { (WANDER_RAD, TURN_SHARE, 1) };
        let weights = [
            1.0 / (ALONG_M * ALONG_M * path + LEAST_M2 + doubt),
            1.0 / (ACROSS_M * ACROSS_M * path + LEAST_M2 + doubt),
            1.0 / (wander * wander * path + share * share * u.yaw * u.yaw + LEAST_RAD2 + doubt),
        ];
        let axes = unit(before.yaw);
        let [ahead, aside] = along(axes, [now.x - before.x, now.y - before.y]);
        let expected = estimate.calibration.corrected(&step);
        let residuals = [ahead - expected.x, aside - expected.y, wrap(now.yaw - before.yaw - expected.yaw)];
        let mut rows = relative([layout.node(node - 1), layout.node(node)], axes, [ahead, aside]);
        rows[0].push((layout.calibration, u.x));
        rows[1].push((layout.calibration, u.y));
        rows[2].extend([(layout.calibration + errors, u.yaw), (layout.calibration + errors + 1, path)]);
        for ((e, w), row) in residuals.into_iter().zip(weights).zip(&rows) {
            envelope.add(e, w, row);
        }
    }
}

pub(super) fn priors(envelope: &mut Envelope, layout: &Layout, estimate: &Estimate, span: Span) {
    let known = &estimate.calibration;
    let known = [known.distance, known.wheels.turn, known.wheels.curvature, known.camera.turn, known.camera.curvature];
    for (k, (number, deviation)) in known.into_iter().zip(PRIORS).enumerate() {
        let weight = 1.0 / (deviation * deviation);
        let (e, w) = if span == Span::Everything { (number, weight) } else { (0.0, HELD * weight) };
        envelope.add(e, w, &[(layout.calibration + k, 1.0)]);
    }
    // The direction is free over the whole drive; a window holds it.
    let stiffness = if span == Span::Everything { 1e-4 } else { 1e8 };
    envelope.add(0.0, stiffness, &[(layout.direction, 1.0)]);
}

/// Error of a wall against the building's direction, where the wall has one.
fn square_error(line: &Line, direction: Option<f64>) -> Option<f64> {
    let error = wrap_square(line.normal - direction?);
    (line.length() >= RIGHT_ANGLE_FROM_M && error.abs() < RIGHT_ANGLE_GATE_RAD).then_some(error)
}

/// Whether a line is certainly a wall.
pub(crate) fn is_confirmed(line: &Line, direction: Option<f64>) -> bool {
    let is_square = square_error(line, direction).is_some_and(|error| error.abs() < SQUARE_RAD);
    line.length() > if is_square { CONFIRMED_SQUARE_M } else { CONFIRMED_M }
}

pub(super) fn walls(envelope: &mut Envelope, layout: &Layout, graph: &Graph, estimate: &Estimate, model: &Model) {
    for &(number, column) in &layout.lines {
        let line = &estimate.lines[number];
        let normal = unit(line.normal);
        let middle = &graph.echoes[line.echoes[line.echoes.len() / 2] as usize];
        let axis = estimate.poses[middle.node as usize].yaw + middle.mount().yaw;
        let turned = layout.node(middle.node as usize).map(|node| (node + 2, -1.0));
        let row: Vec<(usize, f64)> = std::iter::once((column, 1.0)).chain(turned).collect();
        envelope.add(wrap(line.normal - axis), 1.0 / (AXIS_RAD * AXIS_RAD), &row);
        if let Some(error) = square_error(line, estimate.direction) {
            let share = error / RIGHT_ANGLE_SCALE_RAD;
            let robust = if model.right_angles == RightAngles::On { 1.0 } else { 1.0 / (1.0 + share * share) };
            envelope.add(error, robust * robust / (RIGHT_ANGLE_RAD * RIGHT_ANGLE_RAD), &[(column, 1.0), (layout.direction, -1.0)]);
        }
        let share_of_weight = if is_confirmed(line, estimate.direction) { 1.0 } else { SHORT_WEIGHT };
        for (echo, sonar) in Sonars::new(graph, &estimate.poses, &line.echoes) {
            if wrap(sonar.yaw - line.normal).abs() > model.reach_rad() + TURNED_AWAY_RAD {
                continue;
            }
            let [ahead, aside] = along(normal, [sonar.x - line.anchor[0], sonar.y - line.anchor[1]]);
            let e = echo.range() - line.offset + ahead;
            let deviation = range_deviation(echo.range(), estimate.deviation_m);
            let share = e / (CAUCHY * deviation);
            let w = share_of_weight / ((1.0 + share * share) * deviation * deviation);
            let of_line = [(column, aside), (column + 1, -1.0)];
            match layout.node(echo.node as usize) {
                Some(node) => {
                    let pose = &estimate.poses[echo.node as usize];
                    let turning = normal[1] * (sonar.x - pose.x) - normal[0] * (sonar.y - pose.y);
                    envelope.add(e, w, &[of_line[0], of_line[1], (node, normal[0]), (node + 1, normal[1]), (node + 2, turning)]);
                }
                None => envelope.add(e, w, &of_line),
            }
        }
    }
}

/// Error of a closure in the frame of its earlier node, and its square in deviations.
fn closure_error(closure: &Closure, poses: &[Rigid]) -> ([f64; 3], f64) {
    let found = poses[closure.earlier as usize].to(&poses[closure.later as usize]);
    let wanted = closure.relative;
    let e = [found.x - wanted.x, found.y - wanted.y, wrap(found.yaw - wanted.yaw)];
    let square = (0..3).flat_map(|i| (0..3).map(move |j| (i, j))).map(|(i, j)| e[i] * closure.information[i][j] * e[j]).sum();
    (e, square)
}

/// Square of the error of a closure, in deviations.
pub(crate) fn closure_square(closure: &Closure, poses: &[Rigid]) -> f64 {
    closure_error(closure, poses).1
}

/// Sets the weights of the closures, too.
pub(super) fn closures(envelope: &mut Envelope, layout: &Layout, estimate: &mut Estimate, mu: f64) {
    let Estimate { closures, poses, .. } = estimate;
    for closure in closures {
        let columns = [closure.earlier, closure.later].map(|node| layout.node(node as usize));
        if columns[1].is_none() {
            continue;
        }
        let (e, square) = closure_error(closure, poses);
        let scale = mu * CLOSURE_SCALE;
        let share = scale / (scale + square);
        closure.weight = share * share;
        let (earlier, later) = (&poses[closure.earlier as usize], &poses[closure.later as usize]);
        let axes = unit(earlier.yaw);
        let rows = relative(columns, axes, along(axes, [later.x - earlier.x, later.y - earlier.y]));
        let root = square_root(&closure.information);
        for k in 0..3 {
            let mut combined: Vec<(usize, f64)> = Vec::with_capacity(9);
            let mut error = 0.0;
            for ((factors, row), e) in root.iter().zip(&rows).zip(e).skip(k) {
                error += factors[k] * e;
                for &(column, value) in row {
                    match combined.iter_mut().find(|(found, _)| *found == column) {
                        Some((_, sum)) => *sum += factors[k] * value,
                        None => combined.push((column, factors[k] * value)),
                    }
                }
            }
            envelope.add(error, closure.weight, &combined);
        }
    }
}

/// The lower triangle L of L Lᵀ.
fn square_root(matrix: &[[f64; 3]; 3]) -> [[f64; 3]; 3] {
    let mut root = [[0.0; 3]; 3];
    for i in 0..3 {
        for j in 0..=i {
            let known: f64 = (0..j).map(|k| root[i][k] * root[j][k]).sum();
            let rest = matrix[i][j] - known;
            root[i][j] = if i == j { rest.max(1e-9).sqrt() } else { rest / root[j][j] };
        }
    }
    root
}
