//! What stands still, as the camera meets it: upright panels and drums, each from one height to another.

use std::f32::consts::{FRAC_PI_2, TAU};

use super::lattice::mixed;
use super::view::{NEAREST_M, Spot, View};
use crate::geometry::{Segment, Vector};
use crate::still::sides;
use crate::wall::Part;
use crate::world::World;

/// Height of a ceiling, m.
pub(super) const CEILING_M: f32 = 2.6;

/// Height of a doorway, m.
pub(super) const DOORWAY_M: f32 = 2.05;

/// A ray that passes an end of a panel by this share of its length still meets it, so that nothing shines through joints.
const OVERLAP: f32 = 1e-4;

/// What something looks like.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Finish {
    /// A painted wall with what hangs on it.
    Wall,
    /// A wall with nothing on it.
    Plain,
    /// A closed door.
    Door,
    /// A piece of furniture.
    Furniture,
}

/// One thing's look.
#[derive(Debug, Clone, Copy)]
pub(super) struct Look {
    pub(super) finish: Finish,
    /// From this height above the floor,
    pub(super) foot_m: f32,
    /// to this one.
    pub(super) top_m: f32,
    /// How long it is around.
    pub(super) length_m: f32,
    /// How much of the light falls on it.
    pub(super) light: f32,
    /// Makes it unlike its neighbours; all sides of a thing have the same.
    pub(super) mark: u32,
    /// Its number among all panels and drums.
    number: usize,
    /// Number of the thing that it is a side of, if what stands behind can be seen above that.
    solid: Option<usize>,
}

impl Look {
    /// Whether it hides whatever is behind it.
    pub(super) fn is_full(&self) -> bool {
        self.foot_m <= 0.0 && self.top_m >= CEILING_M
    }
}

/// A flat piece.
#[derive(Debug, Clone, Copy)]
struct Panel {
    segment: Segment,
    look: Look,
}

/// A round thing.
#[derive(Debug, Clone, Copy)]
struct Drum {
    centre: Vector,
    radius_m: f32,
    look: Look,
}

/// Everything that stands still.
#[derive(Debug, Clone, Default)]
pub(super) struct Scene {
    panels: Vec<Panel>,
    drums: Vec<Drum>,
}

/// A panel before the lens.
#[derive(Debug, Clone, Copy)]
struct Facing {
    from: Spot,
    /// Its other end, from the first one.
    across: Spot,
    /// Columns that it may be seen in.
    columns_px: [f32; 2],
    look: Look,
}

/// A drum before the lens.
#[derive(Debug, Clone, Copy)]
struct Bulge {
    centre: Spot,
    /// The view's direction in the world: cosine and sine.
    towards: [f32; 2],
    radius_m: f32,
    look: Look,
}

/// What of a scene a view may show.
#[derive(Debug, Clone, Default)]
pub(super) struct Visible {
    facings: Vec<Facing>,
    bulges: Vec<Bulge>,
}

/// Where a column meets something.
#[derive(Debug, Clone, Copy)]
pub(super) struct Meeting {
    pub(super) ahead_m: f32,
    /// Where along the thing, m.
    pub(super) along_m: f32,
    /// How much of it a column of 1 px shows, m.
    pub(super) spread_m: f32,
    pub(super) look: Look,
}

impl Scene {
    /// The scene of a world; the seed decides what hangs where.
    pub(super) fn of(world: &World, seed: u32) -> Self {
        let mut scene = Self::default();
        for wall in &world.walls {
            for piece in wall.pieces() {
                let (finish, light) = match piece.part {
                    Part::Wall => (Finish::Wall, 1.0),
                    Part::Jamb => (Finish::Plain, 0.72),
                    Part::Leaf => (Finish::Door, 1.0),
                };
                scene.panel(piece.segment, finish, [0.0, CEILING_M], light, None, seed);
            }
            for lintel in wall.passages() {
                scene.panel(lintel, Finish::Plain, [DOORWAY_M, CEILING_M], 0.95, None, seed);
            }
        }
        for (number, furniture) in world.boxes.iter().enumerate() {
            for (segment, _) in sides(furniture) {
                scene.panel(segment, Finish::Furniture, [0.0, furniture.height_m.get() as f32], 1.0, Some(number), seed);
            }
        }
        for (number, pillar) in (world.boxes.len()..).zip(&world.pillars) {
            let radius_m = pillar.radius_m.get() as f32;
            let top_m = pillar.height_m.map_or(CEILING_M, |height| height.get() as f32);
            let finish = if pillar.height_m.is_some() { Finish::Furniture } else { Finish::Plain };
            let mark = mark(seed, number);
            let index = scene.panels.len() + scene.drums.len();
            let look = Look { finish, foot_m: 0.0, top_m, length_m: TAU * radius_m, light: 0.85, mark, number: index, solid: Some(number) };
            scene.drums.push(Drum { centre: pillar.centre_m.vector(), radius_m, look });
        }
        scene
    }

    fn panel(&mut self, segment: Segment, finish: Finish, heights_m: [f32; 2], light: f32, solid: Option<usize>, seed: u32) {
        let along = segment.to - segment.from;
        let length = along.norm();
        // Light comes along the rooms: what stands across them is darker.
        let across = if length > 0.0 { (along.y / length).abs() as f32 } else { 0.0 };
        let number = self.panels.len();
        let mark = mark(seed, solid.unwrap_or(usize::MAX - number));
        let [foot_m, top_m] = heights_m;
        let look = Look { finish, foot_m, top_m, length_m: length as f32, light: light * (1.0 - 0.12 * across), mark, number, solid };
        self.panels.push(Panel { segment, look });
    }

    /// What of it a view may show.
    pub(super) fn seen_by(&self, view: &View, visible: &mut Visible) {
        visible.facings.clear();
        visible.facings.extend(self.panels.iter().filter_map(|panel| {
            let [from, to] = [panel.segment.from, panel.segment.to].map(|end| view.spot(&end));
            let across = Spot { ahead_m: to.ahead_m - from.ahead_m, left_m: to.left_m - from.left_m };
            (from.ahead_m > NEAREST_M || to.ahead_m > NEAREST_M).then(|| Facing {
                from,
                across,
                columns_px: columns_px(view, from, to),
                look: panel.look,
            })
        }));
        visible.bulges.clear();
        visible.bulges.extend(self.drums.iter().filter_map(|drum| {
            let centre = view.spot(&drum.centre);
            (centre.ahead_m > -drum.radius_m).then_some(Bulge { centre, towards: view.towards(), radius_m: drum.radius_m, look: drum.look })
        }));
    }
}

fn mark(seed: u32, number: usize) -> u32 {
    mixed(seed, number as i32, 0)
}

/// The columns between two ends, with a px to spare; all on the side of an end that is not before the lens.
fn columns_px(view: &View, from: Spot, to: Spot) -> [f32; 2] {
    let edge = |end: Spot, other: Spot| match end.ahead_m > NEAREST_M {
        true => view.column_px(end),
        false => {
            // The panel leaves the view there.
            let share = (NEAREST_M - other.ahead_m) / (end.ahead_m - other.ahead_m);
            view.column_px(Spot { ahead_m: NEAREST_M, left_m: other.left_m + share * (end.left_m - other.left_m) })
        }
    };
    let (a, b) = (edge(from, to), edge(to, from));
    [a.min(b) - 1.0, a.max(b) + 1.0]
}

impl Visible {
    /// Everything that a column meets up to the first thing that hides the rest, the nearest first.
    pub(super) fn met_by(&self, column_px: f32, slope: f32, focal_px: f32, met: &mut Vec<Meeting>) {
        met.clear();
        for facing in &self.facings {
            if column_px >= facing.columns_px[0] && column_px <= facing.columns_px[1] {
                met.extend(facing.met_by(slope, focal_px));
            }
        }
        for bulge in &self.bulges {
            met.extend(bulge.met_by(slope, focal_px).into_iter().flatten());
        }
        met.sort_by(|a, b| a.ahead_m.total_cmp(&b.ahead_m));
        if let Some(hides) = met.iter().position(|meeting| meeting.look.is_full()) {
            met.truncate(hides + 1);
        }
    }
}

impl Meeting {
    /// Whether both are of the same panel or drum.
    pub(super) fn is_of(&self, other: &Self) -> bool {
        self.look.number == other.look.number
    }

    /// How far ahead the thing begins on whose far side this is.
    pub(super) fn near_side_m(&self, nearer: &[Self]) -> Option<f32> {
        let solid = self.look.solid?;
        nearer.iter().find(|other| other.look.solid == Some(solid)).map(|other| other.ahead_m)
    }
}

impl Facing {
    fn met_by(&self, slope: f32, focal_px: f32) -> Option<Meeting> {
        let Self { from, across, look, .. } = self;
        let closing = across.left_m - slope * across.ahead_m;
        let beside_m = slope * from.ahead_m - from.left_m;
        let share = beside_m / closing;
        let ahead_m = from.ahead_m + share * across.ahead_m;
        if !(-OVERLAP..=1.0 + OVERLAP).contains(&share) || ahead_m <= NEAREST_M {
            return None;
        }
        let change = (from.ahead_m * closing + beside_m * across.ahead_m) / (closing * closing);
        Some(Meeting { ahead_m, along_m: share * look.length_m, spread_m: change.abs() * look.length_m / focal_px, look: *look })
    }
}

impl Bulge {
    fn met_by(&self, slope: f32, focal_px: f32) -> Option<[Meeting; 2]> {
        let [near_m, far_m] = crossing(self.centre, self.radius_m, slope)?;
        let meeting = |ahead_m: f32| {
            let (x, y) = (ahead_m - self.centre.ahead_m, slope * ahead_m - self.centre.left_m);
            let [cos, sin] = self.towards;
            let along_m = self.radius_m * turned(x * cos - y * sin, x * sin + y * cos);
            let facing = (-x / self.radius_m).max(0.15);
            let look = Look { light: self.look.light * (0.75 + 0.25 * facing), ..self.look };
            Meeting { ahead_m, along_m, spread_m: ahead_m / focal_px / facing, look }
        };
        (near_m > NEAREST_M).then(|| [meeting(near_m), meeting(far_m)])
    }
}

/// How far around a place lies, about in rad: along the sides of a diamond, which needs no trigonometry.
fn turned(x: f32, y: f32) -> f32 {
    let quarters = y / (x.abs() + y.abs());
    FRAC_PI_2 * if x >= 0.0 { quarters } else { 2.0 - quarters }
}

/// Where a column enters a circle and where it leaves it, m ahead.
pub(super) fn crossing(centre: Spot, radius_m: f32, slope: f32) -> Option<[f32; 2]> {
    let stretch = 1.0 + slope * slope;
    let middle = (centre.ahead_m + slope * centre.left_m) / stretch;
    let beside = slope * centre.ahead_m - centre.left_m;
    let half_squared = (radius_m * radius_m - beside * beside / stretch) / stretch;
    (half_squared > 0.0).then(|| [middle - half_squared.sqrt(), middle + half_squared.sqrt()])
}
