//! Walkers on the robot's own path, ahead of it or behind.

use geometry::wrapped;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use simulator::Timetable;

use super::floor::{Floor, PERSON_M};
use super::plan::{Goal, Person, STEP_S, Spot};

/// Change of the robot's heading that makes a corner of the path, rad.
const CORNER_RAD: f64 = 0.2;
/// Corners nearer than this are one, m.
const SAME_M: f64 = 0.05;
/// Shorter waits at a corner are left out, s.
const SHORT_S: f64 = 0.4;
/// How far a walker steps aside at the end, m.
const ASIDE_M: f64 = 0.9;

/// Walks ahead of the robot along its path and waits where it turns.
pub(super) fn lead(floor: &Floor, speed_m_s: f64, drive: &Timetable, chance: &mut ChaCha8Rng) -> Option<Person> {
    convoy("Leads the robot", floor, speed_m_s, drive, chance.random_range(0.8..1.8), chance)
}

/// Walks behind the robot.
pub(super) fn follow(floor: &Floor, speed_m_s: f64, drive: &Timetable, chance: &mut ChaCha8Rng) -> Option<Person> {
    convoy("Follows the robot", floor, speed_m_s, drive, -chance.random_range(0.8..1.6), chance)
}

/// A walker so far ahead of the robot, for 12 to 45 s; a negative distance is behind it.
fn convoy(role: &'static str, floor: &Floor, speed_m_s: f64, drive: &Timetable, ahead_m: f64, chance: &mut ChaCha8Rng) -> Option<Person> {
    let lag_s = ahead_m / speed_m_s;
    let begin_s = if ahead_m > 0.0 { 1.0 } else { 1.0 - lag_s + chance.random_range(0.0..10.0) };
    let until_s = (begin_s + chance.random_range(12.0..45.0)).min(drive.end_s() - lag_s.max(0.0));
    let corners = corners(drive, begin_s, until_s, lag_s);
    let (&(start_s, from), rest) = corners.split_first()?;
    let (_, before) = rest.len().checked_sub(1).and_then(|last| corners.get(last)).copied()?;
    let (mut path, mut clock_s, mut at): (Vec<Goal>, f64, Spot) = (Vec::new(), start_s, from);
    for &(arrives_s, spot) in rest {
        let walk_s = distance_m(at, spot) / speed_m_s;
        let wait_s = (arrives_s - clock_s - walk_s).max(0.0);
        // The walker waits before the corner while the robot turns.
        if let Some(last) = path.last_mut() {
            last.stop_s = if wait_s > SHORT_S { wait_s } else { 0.0 };
        }
        path.push(Goal { to: spot, stop_s: 0.0 });
        clock_s += walk_s + wait_s;
        at = spot;
    }
    path.extend(aside(floor, before, at).map(|to| Goal { to, stop_s: 0.0 }));
    Some(Person { role, from, start_s, speed_m_s, step_m: chance.random_range(0.3..0.5), path })
}

/// Times and places of the walker's corners: those of the robot, which is there by `lag_s` later.
fn corners(drive: &Timetable, begin_s: f64, until_s: f64, lag_s: f64) -> Vec<(f64, Spot)> {
    let mut corners: Vec<(f64, Spot)> = Vec::new();
    let mut last_yaw: Option<f64> = None;
    let mut time_s = begin_s;
    while time_s < until_s {
        let pose = drive.robot(time_s + lag_s);
        if last_yaw.is_none_or(|last| wrapped(pose.yaw_rad - last).abs() > CORNER_RAD) {
            corners.push((time_s, [pose.x_m, pose.y_m]));
            last_yaw = Some(pose.yaw_rad);
        }
        time_s += STEP_S;
    }
    let last = drive.robot(time_s + lag_s);
    corners.push((time_s, [last.x_m, last.y_m]));
    corners.dedup_by(|later, earlier| distance_m(earlier.1, later.1) < SAME_M);
    corners
}

/// A free place to the left or the right of the end of the path.
fn aside(floor: &Floor, before: Spot, at: Spot) -> Option<Spot> {
    let heading = (at[1] - before[1]).atan2(at[0] - before[0]);
    let beside = |side: f64| [at[0] - side * ASIDE_M * heading.sin(), at[1] + side * ASIDE_M * heading.cos()];
    [1.0, -1.0].map(beside).into_iter().find(|spot| floor.is_free(*spot, PERSON_M))
}

fn distance_m(from: Spot, to: Spot) -> f64 {
    (to[0] - from[0]).hypot(to[1] - from[1])
}
