//! The walkers of a random building and their paths.

use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use simulator::quantity::{Position, Seconds, StepLength, WalkSpeed, WalkerHeight};
use simulator::world::{self, MAX_WALKERS};
use simulator::{Timetable, World};

use super::convoy;
use super::floor::{Floor, PERSON_M, length_m};
use super::plan::{Goal, Person, Plan, STEP_S, Spot};

/// Nearest that a walker comes to the robot, m: 0.25 m for the robot, 0.3 m for the walker.
const APART_M: f64 = 0.55;
/// Walking speeds of people in buildings, m/s.
const SPEED_M_S: std::ops::Range<f64> = 0.6..1.4;
/// Most tries for one person.
const TRIES: usize = 30;

/// Adds people to a plan whose robot drives already; `empty` is its world without them.
pub(super) fn people(plan: &mut Plan, empty: &World, chance: &mut ChaCha8Rng) {
    let drive = Timetable::of(empty);
    let floor = Floor::new(plan);
    let roles = chance.random_range(3..7);
    for _ in 0..roles {
        for _ in 0..TRIES {
            let added = match chance.random_range(0..8) {
                0 | 1 => cross(&floor, &drive, chance).map(|person| vec![person]),
                2 => convoy::lead(&floor, plan.speed_m_s, &drive, chance).map(|person| vec![person]),
                3 => convoy::follow(&floor, plan.speed_m_s, &drive, chance).map(|person| vec![person]),
                4 | 5 => stand(&floor, &drive, chance).map(|person| vec![person]),
                6 => talk(&floor, &drive, chance),
                _ => group(&floor, &drive, chance),
            };
            if let Some(added) = added.filter(|added| added.iter().all(|person| keeps_apart(person, empty))) {
                plan.people.extend(added);
                break;
            }
        }
    }
    plan.people.truncate(MAX_WALKERS);
}

/// Heights of the walkers, m: one in eight is a child.
pub(super) fn heights_m(walkers: usize, chance: &mut ChaCha8Rng) -> Vec<f64> {
    let height = |_| if chance.random_bool(0.125) { chance.random_range(1.0..1.4) } else { chance.random_range(1.5..1.95) };
    (0..walkers).map(height).collect()
}

/// Whether the robot passes the walker without touching.
fn keeps_apart(person: &Person, empty: &World) -> bool {
    let Some(walker) = walker(person) else { return false };
    let times = Timetable::of(&World { walkers: vec![walker], ..empty.clone() });
    let steps = (times.end_s() / STEP_S) as usize;
    (0..steps).map(|step| step as f64 * STEP_S).all(|time_s| {
        let robot = times.robot(time_s);
        times.walkers_m(time_s).all(|[x, y]| (x - robot.x_m).hypot(y - robot.y_m) >= APART_M)
    })
}

fn walker(person: &Person) -> Option<world::Walker> {
    let place = |[x, y]: Spot| Position::new(x, y);
    let goal = |goal: &Goal| Some(world::Goal { to_m: place(goal.to)?, stop_s: Seconds::new(goal.stop_s)? });
    Some(world::Walker {
        from_m: place(person.from)?,
        start_s: Seconds::new(person.start_s)?,
        speed_m_s: WalkSpeed::new(person.speed_m_s)?,
        step_m: StepLength::new(person.step_m)?,
        height_m: WalkerHeight::default(),
        path: person.path.iter().map(goal).collect::<Option<_>>()?,
    })
}

fn person(role: &'static str, from: Spot, start_s: f64, chance: &mut ChaCha8Rng, path: Vec<Goal>) -> Person {
    let speed_m_s = chance.random_range(SPEED_M_S);
    Person { role, from, start_s, speed_m_s, step_m: chance.random_range(0.4..0.75), path }
}

fn goals(corners: Vec<Spot>) -> Vec<Goal> {
    corners.into_iter().map(|to| Goal { to, stop_s: 0.0 }).collect()
}

/// A place near where the robot is at a time.
fn near_robot(floor: &Floor, drive: &Timetable, time_s: f64, reach_m: std::ops::Range<f64>, chance: &mut ChaCha8Rng) -> Option<Spot> {
    let at = drive.robot(time_s);
    (0..30).find_map(|_| {
        let (distance_m, turn) = (chance.random_range(reach_m.clone()), chance.random_range(0.0..std::f64::consts::TAU));
        let spot = [at.x_m + distance_m * turn.cos(), at.y_m + distance_m * turn.sin()];
        floor.is_free(spot, PERSON_M).then_some(spot)
    })
}

/// Walks through the building past the robot.
fn cross(floor: &Floor, drive: &Timetable, chance: &mut ChaCha8Rng) -> Option<Person> {
    let meet_s = chance.random_range(3.0..drive.end_s());
    let (from, to) = (floor.random(chance, PERSON_M)?, floor.random(chance, PERSON_M)?);
    let by = near_robot(floor, drive, meet_s, 0.7..2.2, chance)?;
    let (to_meeting, onward) = (floor.path(from, by, PERSON_M)?, floor.path(by, to, PERSON_M)?);
    let mut person = person("Walks past the robot", from, 0.0, chance, Vec::new());
    person.start_s = (meet_s - length_m(from, &to_meeting) / person.speed_m_s).max(0.0);
    person.path = goals(to_meeting);
    person.path.extend(goals(onward));
    Some(person)
}

/// Walks to a place near the robot's path, stands there and leaves.
fn stand(floor: &Floor, drive: &Timetable, chance: &mut ChaCha8Rng) -> Option<Person> {
    let meet_s = chance.random_range(5.0..drive.end_s() + 5.0);
    let (from, to) = (floor.random(chance, PERSON_M)?, floor.random(chance, PERSON_M)?);
    let by = near_robot(floor, drive, meet_s, 0.7..2.0, chance)?;
    let (to_place, onward) = (floor.path(from, by, PERSON_M)?, floor.path(by, to, PERSON_M)?);
    let mut person = person("Stands near the robot's path", from, 0.0, chance, Vec::new());
    let before_s = chance.random_range(0.0..12.0);
    person.start_s = (meet_s - before_s - length_m(from, &to_place) / person.speed_m_s).max(0.0);
    person.path = goals(to_place);
    if let Some(last) = person.path.last_mut() {
        last.stop_s = chance.random_range(4.0..35.0);
    }
    person.path.extend(goals(onward));
    Some(person)
}

/// Two walkers that meet, talk and part.
fn talk(floor: &Floor, drive: &Timetable, chance: &mut ChaCha8Rng) -> Option<Vec<Person>> {
    let first = stand(floor, drive, chance)?;
    let at = first.path.iter().position(|goal| goal.stop_s > 0.0)?;
    let place = first.path.get(at)?.to;
    let turn = chance.random_range(0.0..std::f64::consts::TAU);
    let beside = [place[0] + 0.85 * turn.cos(), place[1] + 0.85 * turn.sin()];
    if !floor.is_free(beside, PERSON_M) {
        return None;
    }
    let (from, to) = (floor.random(chance, PERSON_M)?, floor.random(chance, PERSON_M)?);
    let mut second = person("Talks to the one before", from, first.start_s, chance, goals(floor.path(from, beside, PERSON_M)?));
    if let Some(last) = second.path.last_mut() {
        last.stop_s = first.path.get(at)?.stop_s;
    }
    second.path.extend(goals(floor.path(beside, to, PERSON_M)?));
    Some(vec![first, second])
}

/// Two or three walkers side by side.
fn group(floor: &Floor, drive: &Timetable, chance: &mut ChaCha8Rng) -> Option<Vec<Person>> {
    let first = cross(floor, drive, chance)?;
    let mut all = vec![Person { role: "Walks in a group", ..first.clone() }];
    for number in 1..chance.random_range(2..4_usize) {
        let aside = [chance.random_range(-0.7..0.7), chance.random_range(-0.7..0.7)];
        let moved = |spot: Spot| [spot[0] + aside[0], spot[1] + aside[1]];
        let path: Vec<Goal> = first.path.iter().map(|goal| Goal { to: moved(goal.to), ..*goal }).collect();
        let from = moved(first.from);
        if floor.is_free(from, 0.15) && path.iter().all(|goal| floor.is_free(goal.to, 0.15)) {
            all.push(Person { from, path, start_s: first.start_s + 0.3 * number as f64, ..all[0].clone() });
        }
    }
    (all.len() > 1).then_some(all)
}
