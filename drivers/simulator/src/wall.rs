//! Walls: lines along which closed doors stand back and open doors leave gaps.

use serde::Deserialize;

use crate::geometry::{Segment, Vector};
use crate::quantity::{AlongWall, BuiltLength, JambDepth, Position, Recess};
use crate::world::Surface;

/// `[[wall]]`: a line of straight pieces with its doors.
///
/// It is drawn with the rooms that the robot sees on the left of its direction: doors stand back to the right.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(try_from = "WallTable")]
pub struct Wall {
    surface: Surface,
    along: Vec<Segment>,
    doors: Vec<Opening>,
}

/// `[[wall]]` as it is written.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields, expecting = "a table")]
struct WallTable {
    /// Its corners, at least two.
    along_m: Vec<Position>,
    /// How it reflects.
    #[serde(default)]
    surface: Surface,
    /// `[[wall.door]]`: closed doors.
    #[serde(default, rename = "door")]
    doors: Vec<Door>,
    /// `[[wall.gap]]`: open doors.
    #[serde(default, rename = "gap")]
    gaps: Vec<Gap>,
}

/// `[[wall.door]]`: a closed door.
#[derive(Debug, Clone, Copy, Deserialize)]
#[serde(deny_unknown_fields, expecting = "a table")]
struct Door {
    /// Its middle, along the wall from its first corner.
    at_m: AlongWall,
    /// Its width.
    width_m: BuiltLength,
    /// How far it stands behind the wall.
    #[serde(default)]
    recess_m: Recess,
    /// How it reflects.
    #[serde(default)]
    surface: Surface,
}

/// `[[wall.gap]]`: an open door, or a passage.
#[derive(Debug, Clone, Copy, Deserialize)]
#[serde(deny_unknown_fields, expecting = "a table")]
struct Gap {
    /// Its middle, along the wall from its first corner.
    at_m: AlongWall,
    /// Its width.
    width_m: BuiltLength,
    /// Depth of its jambs: the thickness of the wall.
    #[serde(default)]
    jamb_m: JambDepth,
}

/// A door of either kind within one piece of the wall.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Opening {
    piece: usize,
    /// Along the piece.
    from_m: f64,
    to_m: f64,
    /// Depth of the jambs.
    depth_m: f64,
    leaf: Option<Surface>,
}

/// A straight piece of a wall's surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Piece {
    pub(crate) segment: Segment,
    pub(crate) surface: Surface,
    pub(crate) part: Part,
}

/// What a piece is of a wall.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Part {
    /// The wall itself.
    Wall,
    /// The side of a doorway.
    Jamb,
    /// A closed door.
    Leaf,
}

/// A wall that cannot be built.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
enum WallError {
    #[error("along_m has {found} corners, expected at least 2")]
    Corners { found: usize },
    #[error("along_m goes nowhere at corner {corner}: expected corners at least 0.01 m apart")]
    NoLength { corner: usize },
    #[error("the door at_m = {at_m}, {width_m} m wide, is not within one straight piece of the wall, which is {length_m:.3} m long")]
    Outside { at_m: f64, width_m: f64, length_m: f64 },
    #[error("the doors at_m = {first_m:.3} and {second_m:.3} overlap")]
    Overlap { first_m: f64, second_m: f64 },
}

impl TryFrom<WallTable> for Wall {
    type Error = WallError;

    fn try_from(table: WallTable) -> Result<Self, WallError> {
        let corners: Vec<Vector> = table.along_m.iter().map(|place| place.vector()).collect();
        if corners.len() < 2 {
            return Err(WallError::Corners { found: corners.len() });
        }
        let along: Vec<Segment> = corners.windows(2).map(|pair| Segment { from: pair[0], to: pair[1] }).collect();
        if let Some(corner) = along.iter().position(|piece| (piece.to - piece.from).norm() < 0.01) {
            return Err(WallError::NoLength { corner: corner + 1 });
        }
        let doors = table.doors.iter().map(|d| (d.at_m.get(), d.width_m.get(), d.recess_m.get(), Some(d.surface)));
        let gaps = table.gaps.iter().map(|g| (g.at_m.get(), g.width_m.get(), g.jamb_m.get(), None));
        let mut openings = Vec::new();
        for (at_m, width_m, depth_m, leaf) in doors.chain(gaps) {
            openings.push(place_opening(&along, at_m, width_m, depth_m, leaf)?);
        }
        openings.sort_by(|a, b| a.piece.cmp(&b.piece).then(a.from_m.total_cmp(&b.from_m)));
        for pair in openings.windows(2) {
            if pair[0].piece == pair[1].piece && pair[1].from_m < pair[0].to_m {
                let before_m: f64 = along.iter().take(pair[0].piece).map(length_m).sum();
                let middle_m = |opening: &Opening| before_m + (opening.from_m + opening.to_m) / 2.0;
                return Err(WallError::Overlap { first_m: middle_m(&pair[0]), second_m: middle_m(&pair[1]) });
            }
        }
        Ok(Self { surface: table.surface, along, doors: openings })
    }
}

fn length_m(piece: &Segment) -> f64 {
    (piece.to - piece.from).norm()
}

fn place_opening(along: &[Segment], at_m: f64, width_m: f64, depth_m: f64, leaf: Option<Surface>) -> Result<Opening, WallError> {
    let mut before_m = 0.0;
    for (piece, segment) in along.iter().enumerate() {
        let (from_m, to_m) = (at_m - width_m / 2.0 - before_m, at_m + width_m / 2.0 - before_m);
        let length_m = length_m(segment);
        if from_m >= 0.0 && to_m <= length_m {
            return Ok(Opening { piece, from_m, to_m, depth_m, leaf });
        }
        before_m += length_m;
    }
    Err(WallError::Outside { at_m, width_m, length_m: before_m })
}

impl Wall {
    /// Every straight piece of surface: wall between the doors, jambs, door leaves.
    pub(crate) fn pieces(&self) -> Vec<Piece> {
        let mut pieces = Vec::new();
        for (index, line) in self.along.iter().enumerate() {
            let ahead = (line.to - line.from) / length_m(line);
            let behind = Vector::new(ahead.y, -ahead.x);
            let mut corner = line.from;
            for door in self.doors.iter().filter(|door| door.piece == index) {
                let near = door.ends(line);
                let far = near.map(|place| place + behind * door.depth_m);
                pieces.push(self.piece(corner, near[0], Part::Wall));
                pieces.push(self.piece(near[0], far[0], Part::Jamb));
                if let Some(surface) = door.leaf {
                    pieces.push(Piece { surface, ..self.piece(far[0], far[1], Part::Leaf) });
                }
                pieces.push(self.piece(far[1], near[1], Part::Jamb));
                corner = near[1];
            }
            pieces.push(self.piece(corner, line.to, Part::Wall));
        }
        pieces.retain(|piece| length_m(&piece.segment) > 1e-9);
        pieces
    }

    /// The lines across its open doors, along the wall.
    pub(crate) fn passages(&self) -> Vec<Segment> {
        let open = self.doors.iter().filter(|door| door.leaf.is_none());
        open.filter_map(|door| Some((door, self.along.get(door.piece)?)))
            .map(|(door, line)| {
                let [from, to] = door.ends(line);
                Segment { from, to }
            })
            .collect()
    }

    fn piece(&self, from: Vector, to: Vector, part: Part) -> Piece {
        Piece { segment: Segment { from, to }, surface: self.surface, part }
    }
}

impl Opening {
    /// Where it begins and ends in its piece of the wall.
    fn ends(&self, line: &Segment) -> [Vector; 2] {
        let ahead = (line.to - line.from) / length_m(line);
        [line.from + ahead * self.from_m, line.from + ahead * self.to_m]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn wall(toml: &str) -> Result<Wall, document::DocumentError> {
        document::parse("test", toml)
    }

    #[test]
    fn a_closed_door_stands_back_and_an_open_one_leaves_a_gap() {
        let wall = wall(
            "along_m = [[0, 0], [6, 0]]
             door = [{ at_m = 1.5, width_m = 1, recess_m = 0.25, surface = 'rough' }]
             gap = [{ at_m = 4, width_m = 1, jamb_m = 0.1 }]",
        )
        .unwrap();
        let pieces = wall.pieces();
        let expected: [([f64; 4], Surface); 8] = [
            ([0.0, 0.0, 1.0, 0.0], Surface::Smooth),
            ([1.0, 0.0, 1.0, -0.25], Surface::Smooth),
            ([1.0, -0.25, 2.0, -0.25], Surface::Rough),
            ([2.0, -0.25, 2.0, 0.0], Surface::Smooth),
            ([2.0, 0.0, 3.5, 0.0], Surface::Smooth),
            ([3.5, 0.0, 3.5, -0.1], Surface::Smooth),
            ([4.5, -0.1, 4.5, 0.0], Surface::Smooth),
            ([4.5, 0.0, 6.0, 0.0], Surface::Smooth),
        ];
        assert_eq!(pieces.len(), expected.len());
        assert_eq!(pieces.iter().position(|piece| piece.part == Part::Leaf), Some(2));
        assert_eq!(wall.passages(), [Segment { from: Vector::new(3.5, 0.0), to: Vector::new(4.5, 0.0) }]);
        for (Piece { segment, surface, .. }, (ends, expected)) in pieces.iter().zip(expected) {
            assert_eq!(([segment.from.x, segment.from.y, segment.to.x, segment.to.y], *surface), (ends, expected));
        }
    }

    #[test]
    fn doors_that_cannot_be_built_are_refused() {
        for (toml, says) in [
            ("along_m = [[0, 0]]", "has 1 corners"),
            ("along_m = [[0, 0], [0, 0], [1, 0]]", "at corner 1"),
            ("along_m = [[0, 0], [2, 0], [4, 0]]\ndoor = [{ at_m = 2, width_m = 1 }]", "the door at_m = 2, 1 m wide"),
            ("along_m = [[0, 0], [2, 0]]\ngap = [{ at_m = 2, width_m = 1 }]", "2.000 m long"),
            (
                "along_m = [[0, 0], [5, 0]]\ndoor = [{ at_m = 2, width_m = 1 }]\ngap = [{ at_m = 1.5, width_m = 1 }]",
                "1.500 and 2.000 overlap",
            ),
        ] {
            let message = wall(toml).unwrap_err().to_string();
            assert!(message.contains(says), "{message}");
        }
    }
}
