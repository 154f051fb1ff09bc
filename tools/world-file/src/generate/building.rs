//! What stands: walls, doors, furniture and pillars of a random building.

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::plan::{Furniture, Line, Opening, Pillar, Plan, Spot};

/// A building of a random kind.
pub(super) fn build(chance: &mut ChaCha8Rng) -> Plan {
    match chance.random_range(0..6) {
        0 => hall(chance),
        1 => office(chance),
        2 => corridor(chance),
        3 => corner(chance),
        4 => ring(chance),
        _ => rooms(chance),
    }
}

/// Walls around a room, the room on their left, with doors.
fn around(chance: &mut ChaCha8Rng, [[x0, y0], [x1, y1]]: [Spot; 2], doors: usize) -> Line {
    let corners = vec![[x0, y0], [x1, y0], [x1, y1], [x0, y1], [x0, y0]];
    line(chance, corners, doors)
}

/// A wall with up to so many doors and gaps, which do not overlap.
fn line(chance: &mut ChaCha8Rng, corners: Vec<Spot>, doors: usize) -> Line {
    let lengths: Vec<f64> = corners.windows(2).map(|pair| (pair[1][0] - pair[0][0]).hypot(pair[1][1] - pair[0][1])).collect();
    let mut openings: Vec<Opening> = Vec::new();
    for _ in 0..doors {
        let piece = chance.random_range(0..lengths.len());
        let before: f64 = lengths.iter().take(piece).sum();
        let width_m = chance.random_range(0.8..1.4);
        let length = lengths[piece];
        if length < width_m + 1.2 {
            continue;
        }
        let at_m = before + chance.random_range(0.6 + width_m / 2.0..length - 0.6 - width_m / 2.0);
        let closed = chance.random_bool(0.75);
        if openings.iter().all(|other| (other.at_m - at_m).abs() > (other.width_m + width_m) / 2.0 + 0.3) {
            openings.push(Opening { at_m, width_m, depth_m: chance.random_range(0.05..0.3), closed });
        }
    }
    Line { corners, openings, rough: chance.random_bool(0.25) }
}

fn thing(chance: &mut ChaCha8Rng, plan: &Plan) -> Option<Furniture> {
    let [[x0, y0], [x1, y1]] = *plan.rooms.get(chance.random_range(0..plan.rooms.len()))?;
    let size = [chance.random_range(0.4..1.8), chance.random_range(0.4..1.0)];
    let (half_x, half_y) = (size[0] / 2.0, size[1] / 2.0);
    if x1 - x0 < size[0] + 0.2 || y1 - y0 < size[1] + 0.2 {
        return None;
    }
    // Most furniture stands at a wall.
    let mut centre = [chance.random_range(x0 + half_x..x1 - half_x), chance.random_range(y0 + half_y..y1 - half_y)];
    match chance.random_range(0..5) {
        0 => centre[0] = x0 + half_x + 0.02,
        1 => centre[0] = x1 - half_x - 0.02,
        2 => centre[1] = y0 + half_y + 0.02,
        3 => centre[1] = y1 - half_y - 0.02,
        _ => {}
    }
    Some(Furniture { centre, size, height_m: chance.random_range(0.5..2.0), rough: chance.random_bool(0.4) })
}

fn furnish(chance: &mut ChaCha8Rng, plan: &mut Plan, things: usize, pillars: usize) {
    for _ in 0..things {
        if let Some(thing) = thing(chance, plan) {
            plan.boxes.push(thing);
        }
    }
    for _ in 0..pillars {
        let [[x0, y0], [x1, y1]] = plan.rooms[chance.random_range(0..plan.rooms.len())];
        let radius_m = chance.random_range(0.1..0.4);
        if x1 - x0 < 2.0 || y1 - y0 < 2.0 {
            continue;
        }
        let centre = [chance.random_range(x0 + 0.6..x1 - 0.6), chance.random_range(y0 + 0.6..y1 - 0.6)];
        let height_m = chance.random_bool(0.4).then(|| chance.random_range(0.5..1.2));
        plan.pillars.push(Pillar { centre, radius_m, height_m, rough: chance.random_bool(0.5) });
    }
}

fn hall(chance: &mut ChaCha8Rng) -> Plan {
    let area = [[0.0, 0.0], [chance.random_range(8.0..14.0), chance.random_range(6.0..10.0)]];
    let doors = chance.random_range(1..5);
    let walls = vec![around(chance, area, doors)];
    let mut plan = Plan { kind: "hall", extent: area, rooms: vec![area], walls, ..Plan::default() };
    let (things, pillars) = (chance.random_range(1..5), chance.random_range(2..7));
    furnish(chance, &mut plan, things, pillars);
    plan
}

fn office(chance: &mut ChaCha8Rng) -> Plan {
    let area = [[0.0, 0.0], [chance.random_range(6.5..11.0), chance.random_range(5.5..8.0)]];
    let doors = chance.random_range(1..4);
    let walls = vec![around(chance, area, doors)];
    let mut plan = Plan { kind: "office", extent: area, rooms: vec![area], walls, ..Plan::default() };
    let [x1, y1] = area[1];
    // Desks back to back, with aisles around them.
    for column in 0..(((x1 - 2.4) / 2.6) as usize) {
        let x = 2.0 + 2.6 * column as f64;
        let rough = chance.random_bool(0.3);
        for side in [-0.4, 0.4] {
            if chance.random_bool(0.8) {
                plan.boxes.push(Furniture { centre: [x, y1 / 2.0 + side], size: [1.4, 0.75], height_m: 0.75, rough });
            }
        }
    }
    let (things, pillars) = (chance.random_range(2..6), chance.random_range(0..3));
    furnish(chance, &mut plan, things, pillars);
    plan
}

fn corridor(chance: &mut ChaCha8Rng) -> Plan {
    let (length, width) = (chance.random_range(10.0..18.0), chance.random_range(1.7..3.0));
    let area = [[0.0, 0.0], [length, width]];
    let (near, far) = (chance.random_range(2..6), chance.random_range(2..6));
    let walls = vec![
        line(chance, vec![[0.0, 0.0], [length, 0.0], [length, width]], near),
        line(chance, vec![[length, width], [0.0, width], [0.0, 0.0]], far),
    ];
    let mut plan = Plan { kind: "corridor", extent: area, rooms: vec![area], walls, ..Plan::default() };
    let things = chance.random_range(0..3);
    furnish(chance, &mut plan, things, 0);
    plan
}

/// A corridor with a corner.
fn corner(chance: &mut ChaCha8Rng) -> Plan {
    let (x1, y1) = (chance.random_range(6.0..10.0), chance.random_range(6.0..10.0));
    let (w, h) = (chance.random_range(1.8..2.8), chance.random_range(1.8..2.8));
    let (outer, inner) = (chance.random_range(2..6), chance.random_range(1..4));
    let walls = vec![
        line(chance, vec![[0.0, 0.0], [x1, 0.0], [x1, y1], [x1 - w, y1]], outer),
        line(chance, vec![[x1 - w, y1], [x1 - w, h], [0.0, h], [0.0, 0.0]], inner),
    ];
    let rooms = vec![[[0.0, 0.0], [x1, h]], [[x1 - w, 0.0], [x1, y1]]];
    let mut plan = Plan { kind: "corridor with a corner", extent: [[0.0, 0.0], [x1, y1]], rooms, walls, ..Plan::default() };
    let things = chance.random_range(0..3);
    furnish(chance, &mut plan, things, 0);
    plan
}

/// A corridor round a block.
fn ring(chance: &mut ChaCha8Rng) -> Plan {
    let (x1, y1) = (chance.random_range(8.0..12.0), chance.random_range(7.0..9.5));
    let w = chance.random_range(1.8..2.5);
    let area = [[0.0, 0.0], [x1, y1]];
    let (outer, inner) = (chance.random_range(3..7), chance.random_range(1..5));
    // The rooms are on the left of a wall: round the block it runs the other way.
    let block = vec![[w, w], [w, y1 - w], [x1 - w, y1 - w], [x1 - w, w], [w, w]];
    let walls = vec![around(chance, area, outer), line(chance, block, inner)];
    let rooms = vec![[[0.0, 0.0], [x1, w]], [[0.0, y1 - w], [x1, y1]], [[0.0, 0.0], [w, y1]], [[x1 - w, 0.0], [x1, y1]]];
    let mut plan = Plan { kind: "block", extent: area, rooms, walls, ..Plan::default() };
    let things = chance.random_range(0..3);
    furnish(chance, &mut plan, things, 0);
    plan
}

/// Rooms in a row, with passages between.
fn rooms(chance: &mut ChaCha8Rng) -> Plan {
    let (count, height) = (chance.random_range(2..4_usize), chance.random_range(4.0..6.0));
    let widths: Vec<f64> = (0..count).map(|_| chance.random_range(3.5..5.5)).collect();
    let x1: f64 = widths.iter().sum();
    let area = [[0.0, 0.0], [x1, height]];
    let doors = chance.random_range(2..5);
    let mut plan = Plan { kind: "rooms", extent: area, walls: vec![around(chance, area, doors)], ..Plan::default() };
    let mut left = 0.0;
    for (number, width) in widths.iter().enumerate() {
        let right = left + width;
        plan.rooms.push([[left + 0.1, 0.0], [right - 0.1, height]]);
        if number + 1 < count {
            let (passage, at) = (chance.random_range(1.1..1.6), chance.random_range(1.2..height - 1.2));
            let (low, high) = (at - passage / 2.0, at + passage / 2.0);
            for [from, to] in [[0.0, low], [high, height]] {
                let size = [0.12, to - from];
                plan.boxes.push(Furniture { centre: [right, f64::midpoint(from, to)], size, height_m: 2.4, rough: false });
            }
            plan.rooms.push([[right - 0.5, low], [right + 0.5, high]]);
        }
        left = right;
    }
    let (things, pillars) = (chance.random_range(1..6), chance.random_range(0..3));
    furnish(chance, &mut plan, things, pillars);
    plan
}
