//! T the paper's way: landmarks of both frames, iterative closest point, least squares (section 5.1).

use crate::alignment::Pair;
use crate::corners::{Corner, corners};
use crate::estimation::least_squares;
use crate::order;
use crate::plane::Plane;
use crate::pyramid::Level;
use crate::transform::{Class, Transform};

/// Landmarks pair within this distance of where T puts them, px; it shrinks as T gets better.
const GATES_PX: [f64; 5] = [6.0, 4.0, 2.5, 1.5, 1.5];
/// Smallest correlation of the patches of a pair.
const CORRELATION_MIN: f32 = 0.75;
/// Pairs with residuals above this many scaled MAD are trimmed.
const TRIM: f64 = 2.5;
/// But never residuals below this, px: corners are no more exact.
const TRIM_MIN_PX: f64 = 0.3;

/// The transform of a class that maps the landmarks of the current frame onto those of the previous one, from a start nearby.
pub(crate) fn estimate(current: &Level, previous: &Level, moving: &Plane<u8>, class: Class, start: Transform) -> Option<Transform> {
    let (front, background) = (corners(current, moving), corners(previous, moving));
    let mut transform = start;
    for gate in GATES_PX {
        let pairs = trimmed(mutual_pairs(&front, &background, &transform, gate), &transform);
        transform = least_squares(class, &pairs)?;
    }
    Some(transform)
}

/// Pairs of landmarks that are each other's nearest among those that look alike.
fn mutual_pairs(front: &[Corner], background: &[Corner], transform: &Transform, gate: f64) -> Vec<Pair> {
    let expected: Vec<[f64; 2]> = front.iter().map(|c| transform.apply(c.place)).collect();
    let distance = |f: usize, b: usize| {
        let (e, p) = (expected[f], background[b].place);
        (e[0] - p[0]).hypot(e[1] - p[1])
    };
    let alike = |f: usize, b: usize| distance(f, b) <= gate && front[f].correlation(&background[b]) >= CORRELATION_MIN;
    let nearest_background =
        |f: usize| (0..background.len()).filter(|&b| alike(f, b)).min_by(|&a, &b| distance(f, a).total_cmp(&distance(f, b)));
    let nearest_front = |b: usize| (0..front.len()).filter(|&f| alike(f, b)).min_by(|&a, &c| distance(a, b).total_cmp(&distance(c, b)));
    (0..front.len())
        .filter_map(|f| nearest_background(f).map(|b| (f, b)))
        .filter(|&(f, b)| nearest_front(b) == Some(f))
        .map(|(f, b)| Pair { frame: front[f].place, background: background[b].place })
        .collect()
}

fn trimmed(pairs: Vec<Pair>, transform: &Transform) -> Vec<Pair> {
    let residuals: Vec<[f64; 2]> = pairs
        .iter()
        .map(|p| {
            let [u, v] = transform.apply(p.frame);
            [p.background[0] - u, p.background[1] - v]
        })
        .collect();
    let middle = |k: usize| order::median(&residuals.iter().map(|r| r[k]).collect::<Vec<_>>()).unwrap_or(0.0);
    // The common part of the residuals is what the next T corrects; only what differs from it is trimmed.
    let centre = [middle(0), middle(1)];
    let sizes: Vec<f64> = residuals.iter().map(|r| (r[0] - centre[0]).hypot(r[1] - centre[1])).collect();
    let limit = (TRIM * 1.4826 * order::median(&sizes).unwrap_or(0.0)).max(TRIM_MIN_PX);
    pairs.into_iter().zip(sizes).filter(|(_, size)| *size <= limit).map(|(pair, _)| pair).collect()
}
