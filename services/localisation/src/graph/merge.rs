//! Lines that are one wall.

use super::solve::anchor;
use super::{Estimate, Graph};
use crate::rigid::wrap;

/// Lines whose normals differ by less are parallel, rad: 4°.
const PARALLEL_RAD: f64 = 0.07;
/// Share of the gate within which two lines lie on each other.
const GATE_SHARE: f64 = 0.8;
/// Widest gap between the ends of one wall's lines, m: a door.
const GAP_M: f64 = 0.8;

/// Merges lines that lie on each other within `gate` (m) into the first of them. The result names, for each line, the one that has
/// its echoes now.
pub(crate) fn merge(graph: &Graph, estimate: &mut Estimate, gate: f64) -> Vec<u32> {
    let mut owners: Vec<u32> = (0..estimate.lines.len() as u32).collect();
    for one in 0..estimate.lines.len() {
        for other in one + 1..estimate.lines.len() {
            if is_one_wall(&estimate.lines[one], &estimate.lines[other], gate) {
                let echoes = std::mem::take(&mut estimate.lines[other].echoes);
                let line = &mut estimate.lines[one];
                line.echoes.extend(echoes);
                line.echoes.sort_unstable();
                let seen_m = estimate.lines[other].seen_m;
                let line = &mut estimate.lines[one];
                line.seen_m = line.seen_m.max(seen_m);
                owners.iter_mut().filter(|owner| **owner == other as u32).for_each(|owner| *owner = one as u32);
                anchor(graph, estimate, one);
            }
        }
    }
    owners
}

fn is_one_wall(one: &super::Line, other: &super::Line, gate: f64) -> bool {
    if !(one.is_alive() && other.is_alive()) || wrap(one.normal - other.normal).abs() > PARALLEL_RAD {
        return false;
    }
    let [ahead, aside] = one.along(other.anchor);
    let half = other.length() / 2.0;
    let is_near = aside - half <= one.ends[1] + GAP_M && aside + half >= one.ends[0] - GAP_M;
    is_near && (other.offset + ahead - one.offset).abs() <= GATE_SHARE * gate
}
