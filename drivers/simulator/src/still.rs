//! What stands still in a world, as the sonars meet it: faces, round things, and the points where faces end or join.

use std::f64::consts::{PI, TAU};

use crate::geometry::{Circle, Segment, Vector, angle, direction, wrapped};
use crate::world::{Furniture, Pillar, Surface, World};

/// Ends of faces that are nearer to each other than this are joined.
const JOINED_M: f64 = 1e-3;

/// Faces that meet within this of a straight line make no echo of their own.
const FLAT_RAD: f64 = 30.0 / 180.0 * PI;

/// Straight pieces that stand for a round thing where only straight pieces are told.
pub(crate) const PIECES_OF_A_CIRCLE: u32 = 16;

/// A flat piece of surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Face {
    pub(crate) segment: Segment,
    pub(crate) surface: Surface,
}

/// A round piece of surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Round {
    pub(crate) circle: Circle,
    pub(crate) surface: Surface,
}

/// A point where faces end or join.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Joint {
    pub(crate) place: Vector,
    /// Directions in which faces leave it, sorted angles in (−π, π].
    arms_rad: Vec<f64>,
}

/// What a joint is to one who looks at it from some side.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum JointKind {
    /// Faces on both sides of the line of sight: sound comes straight back, as from a retroreflector.
    Corner,
    /// The end of a face, or a corner seen from outside: sound is bent around it, and a little comes back.
    Edge,
    /// Next to nothing: the faces continue almost straight.
    Flat,
}

/// What stands still.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct Still {
    pub(crate) faces: Vec<Face>,
    pub(crate) rounds: Vec<Round>,
    pub(crate) joints: Vec<Joint>,
}

impl Still {
    /// Everything in the world that stands still.
    pub(crate) fn of(world: &World) -> Self {
        let faces = faces(world);
        let joints = joints(&faces);
        Self { faces, rounds: world.pillars.iter().map(round).collect(), joints }
    }

    /// Every surface as straight pieces.
    pub(crate) fn pieces(&self) -> impl Iterator<Item = Segment> {
        self.faces.iter().map(|face| face.segment).chain(self.rounds.iter().flat_map(|round| around(round.circle)))
    }
}

/// Every flat surface of the world.
pub(crate) fn faces(world: &World) -> Vec<Face> {
    let walls = world.walls.iter().flat_map(|wall| wall.pieces()).map(|piece| (piece.segment, piece.surface));
    let boxes = world.boxes.iter().flat_map(sides);
    walls.chain(boxes).map(|(segment, surface)| Face { segment, surface }).collect()
}

/// The sides of a rectangular thing.
pub(crate) fn sides(furniture: &Furniture) -> [(Segment, Surface); 4] {
    let centre = furniture.centre_m.vector();
    let ahead = direction(furniture.heading_deg.get().to_radians());
    let [length_m, width_m] = furniture.size_m.map(|size| size.get() / 2.0);
    let corner = |along: f64, across: f64| centre + ahead * (along * length_m) + Vector::new(-ahead.y, ahead.x) * (across * width_m);
    let side = |from: (f64, f64), to: (f64, f64)| Segment { from: corner(from.0, from.1), to: corner(to.0, to.1) };
    [side((-1.0, -1.0), (1.0, -1.0)), side((1.0, -1.0), (1.0, 1.0)), side((1.0, 1.0), (-1.0, 1.0)), side((-1.0, 1.0), (-1.0, -1.0))]
        .map(|segment| (segment, furniture.surface))
}

fn round(pillar: &Pillar) -> Round {
    Round { circle: Circle { centre: pillar.centre_m.vector(), radius_m: pillar.radius_m.get() }, surface: pillar.surface }
}

fn around(circle: Circle) -> impl Iterator<Item = Segment> {
    let corner = move |index: u32| circle.centre + direction(TAU * f64::from(index) / f64::from(PIECES_OF_A_CIRCLE)) * circle.radius_m;
    (0..PIECES_OF_A_CIRCLE).map(move |index| Segment { from: corner(index), to: corner((index + 1) % PIECES_OF_A_CIRCLE) })
}

fn joints(faces: &[Face]) -> Vec<Joint> {
    let mut joints: Vec<Joint> = Vec::new();
    for place in faces.iter().flat_map(|face| [face.segment.from, face.segment.to]) {
        if joints.iter().all(|joint| (joint.place - place).norm() > JOINED_M) {
            joints.push(Joint { place, arms_rad: arms(faces, &place) });
        }
    }
    joints
}

/// Directions in which faces leave a place: from an end in one direction, from within a face in both.
fn arms(faces: &[Face], place: &Vector) -> Vec<f64> {
    let mut arms: Vec<f64> = faces
        .iter()
        .filter(|face| face.segment.distance_m(place) <= JOINED_M)
        .flat_map(|face| [face.segment.from, face.segment.to])
        .map(|end| end - place)
        .filter(|arm| arm.norm() > JOINED_M)
        .map(|arm| angle(&arm))
        .collect();
    arms.sort_by(f64::total_cmp);
    arms.dedup_by(|a, b| (*a - *b).abs() < 1e-6);
    arms
}

impl Joint {
    /// What the joint is to one who looks at it from `viewer`.
    pub(crate) fn seen_from(&self, viewer: &Vector) -> JointKind {
        let towards_rad = angle(&(viewer - self.place));
        let ahead = self.arms_rad.iter().map(|arm| wrapped(arm - towards_rad).rem_euclid(TAU)).fold(TAU, f64::min);
        let back = self.arms_rad.iter().map(|arm| wrapped(towards_rad - arm).rem_euclid(TAU)).fold(TAU, f64::min);
        let opening_rad = ahead + back;
        if opening_rad < PI - FLAT_RAD {
            JointKind::Corner
        } else if opening_rad > PI + FLAT_RAD {
            JointKind::Edge
        } else {
            JointKind::Flat
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn face(from: [f64; 2], to: [f64; 2]) -> Face {
        Face { segment: Segment { from: from.into(), to: to.into() }, surface: Surface::Smooth }
    }

    #[track_caller]
    fn check(faces: &[Face], joint: [f64; 2], viewer: [f64; 2], expect: JointKind) {
        let joints = joints(faces);
        let joint = joints.iter().find(|found| (found.place - Vector::from(joint)).norm() < 1e-9).unwrap();
        assert_eq!(joint.seen_from(&viewer.into()), expect);
    }

    #[test]
    fn a_right_angle_is_a_corner_inside_and_an_edge_outside() {
        let faces = [face([0.0, 0.0], [2.0, 0.0]), face([2.0, 0.0], [2.0, 2.0])];
        check(&faces, [2.0, 0.0], [1.0, 1.0], JointKind::Corner);
        check(&faces, [2.0, 0.0], [3.0, -1.0], JointKind::Edge);
        check(&faces, [0.0, 0.0], [1.0, 1.0], JointKind::Edge);
    }

    #[test]
    fn a_straight_continuation_has_no_joint() {
        let faces = [face([0.0, 0.0], [2.0, 0.0]), face([2.0, 0.0], [4.0, 0.2])];
        check(&faces, [2.0, 0.0], [2.0, 1.0], JointKind::Flat);
    }

    #[test]
    fn a_wall_that_ends_on_another_makes_two_corners() {
        let faces = [face([0.0, 0.0], [4.0, 0.0]), face([2.0, 0.0], [2.0, 2.0])];
        check(&faces, [2.0, 0.0], [1.0, 1.0], JointKind::Corner);
        check(&faces, [2.0, 0.0], [3.0, 1.0], JointKind::Corner);
        check(&faces, [2.0, 0.0], [2.0, -1.0], JointKind::Flat);
    }
}
