//! How walls, doors and furniture are painted, a column at a time.

use super::column::Column;
use super::lattice::{floored, share};
use super::materials::Materials;
use super::scene::{CEILING_M, DOORWAY_M, Finish, Look, Meeting};
use super::texture::Texture;
use super::view::Sight;

/// Walls are hung with something in stretches of this length.
const STRETCH_M: f32 = 1.7;

/// Light at the foot of a wall, and what it gains up to the ceiling.
const LIGHT_AT_FOOT: f32 = 0.86;
const LIGHT_TO_CEILING: f32 = 0.16;

/// What a patch shows.
#[derive(Debug, Clone, Copy)]
enum Paint<'a> {
    /// One grey level.
    Flat(f32),
    /// A texture from some place of it on, so many times as bright.
    Textured(&'a Texture, f32, f32),
}

/// A rectangle on a surface.
#[derive(Debug, Clone, Copy)]
struct Patch<'a> {
    /// Along the surface, m.
    from_m: f32,
    to_m: f32,
    /// Above the floor, m.
    foot_m: f32,
    top_m: f32,
    paint: Paint<'a>,
}

/// The painter of one column of one surface.
struct Painter<'a> {
    sight: &'a Sight,
    meeting: &'a Meeting,
    materials: &'a Materials,
    column: &'a mut Column,
}

/// Paints what a column meets of a surface.
pub(super) fn paint(column: &mut Column, sight: &Sight, meeting: &Meeting, materials: &Materials) {
    let mut painter = Painter { sight, meeting, materials, column };
    match meeting.look.finish {
        Finish::Wall => painter.wall(),
        Finish::Plain => painter.plain(),
        Finish::Door => painter.door(),
        Finish::Furniture => painter.furniture(),
    }
}

/// Paints the top of a thing from where it begins to the far side that a column meets, if the lens is above it.
pub(super) fn paint_top(column: &mut Column, sight: &Sight, far_side: &Meeting, near_m: f32) {
    let Look { top_m, mark, .. } = far_side.look;
    if sight.height_m > top_m {
        let rows = column.between(sight.row_px(top_m, far_side.ahead_m), sight.row_px(top_m, near_m));
        rows.for_each(|(part, _, pixel)| pixel.cover(part, 90.0 + 90.0 * share(mark, 0, 1)));
    }
}

impl<'a> Painter<'a> {
    fn plain(&mut self) {
        let foot_m = self.meeting.look.foot_m;
        self.plaster(foot_m);
        if foot_m <= 0.0 {
            self.everywhere(0.0, 0.1, Paint::Flat(64.0));
        }
    }

    /// Plaster from this height up.
    fn plaster(&mut self, foot_m: f32) {
        let Look { top_m, mark, .. } = self.meeting.look;
        self.everywhere(foot_m, top_m, Paint::Textured(&self.materials.plaster, offset_m(mark), 1.0));
    }

    fn wall(&mut self) {
        self.plain();
        // Seen from afar a column may show two stretches.
        let reach_m = self.shown_m() / 2.0;
        let [first, last] = [-reach_m, reach_m].map(|aside_m| floored((self.meeting.along_m + aside_m) / STRETCH_M).0);
        self.stretch(first);
        if last != first {
            self.stretch(last);
        }
    }

    /// What hangs on a stretch of wall: perhaps a poster in its frame, perhaps a socket near the floor.
    fn stretch(&mut self, stretch: i32) {
        let Look { mark, length_m, .. } = self.meeting.look;
        let chance = |purpose: i32| share(mark, stretch, purpose);
        let from_m = stretch as f32 * STRETCH_M;
        let (wide_m, high_m) = (0.4 + 0.4 * chance(1), 0.45 + 0.35 * chance(2));
        let (left_m, foot_m) = (from_m + 0.05 + chance(3) * (STRETCH_M - wide_m - 0.1), 0.85 + 0.5 * chance(4));
        if chance(5) < 0.65 && left_m > 0.05 && left_m + wide_m < length_m - 0.05 {
            let frame_m = 0.025;
            let frame = Patch { from_m: left_m, to_m: left_m + wide_m, foot_m, top_m: foot_m + high_m, paint: Paint::Flat(64.0) };
            let poster = Paint::Textured(&self.materials.poster, offset_m(mark) + 0.31 * from_m, 0.7 + 0.5 * chance(6));
            self.patch(&frame);
            self.patch(&Patch {
                from_m: frame.from_m + frame_m,
                to_m: frame.to_m - frame_m,
                foot_m: frame.foot_m + frame_m,
                top_m: frame.top_m - frame_m,
                paint: poster,
            });
        }
        let socket_m = from_m + 0.1 + chance(7) * (STRETCH_M - 0.3);
        if chance(8) < 0.7 && socket_m > 0.05 && socket_m < length_m - 0.2 {
            self.patch(&Patch { from_m: socket_m, to_m: socket_m + 0.15, foot_m: 0.26, top_m: 0.35, paint: Paint::Flat(226.0) });
            self.patch(&Patch { from_m: socket_m + 0.03, to_m: socket_m + 0.12, foot_m: 0.28, top_m: 0.33, paint: Paint::Flat(70.0) });
        }
    }

    fn door(&mut self) {
        self.plaster(DOORWAY_M);
        let Look { length_m, mark, .. } = self.meeting.look;
        let brightness = 0.75 + 0.6 * share(mark, 0, 1);
        self.everywhere(0.0, DOORWAY_M, Paint::Flat(58.0));
        let (from_m, to_m) = (0.06, length_m - 0.06);
        let leaf = Paint::Textured(&self.materials.wood, offset_m(mark), brightness);
        self.patch(&Patch { from_m, to_m, foot_m: 0.01, top_m: DOORWAY_M - 0.06, paint: leaf });
        self.patch(&Patch { from_m, to_m, foot_m: 0.01, top_m: 0.22, paint: Paint::Flat(132.0) });
        self.patch(&Patch { from_m: 0.14, to_m: 0.26, foot_m: 1.0, top_m: 1.06, paint: Paint::Flat(218.0) });
        let middle_m = length_m / 2.0;
        self.patch(&Patch { from_m: middle_m - 0.15, to_m: middle_m + 0.15, foot_m: 1.45, top_m: 1.62, paint: Paint::Flat(206.0) });
    }

    fn furniture(&mut self) {
        let Look { mark, top_m, .. } = self.meeting.look;
        let brightness = 0.6 + 1.1 * share(mark, 0, 1);
        self.everywhere(0.0, top_m, Paint::Textured(&self.materials.wood, offset_m(mark), brightness));
        self.everywhere(0.0, 0.06, Paint::Flat(40.0));
        let drawers = (top_m / 0.24) as u32;
        for drawer in 1..drawers {
            let height_m = top_m * drawer as f32 / drawers as f32;
            self.everywhere(height_m - 0.008, height_m + 0.008, Paint::Flat(48.0));
        }
        self.everywhere(top_m - 0.03, top_m, Paint::Flat(60.0 + 90.0 * brightness));
    }

    fn everywhere(&mut self, foot_m: f32, top_m: f32, paint: Paint<'a>) {
        self.patch(&Patch { from_m: f32::NEG_INFINITY, to_m: f32::INFINITY, foot_m, top_m, paint });
    }

    /// How much of the surface the column shows, m.
    fn shown_m(&self) -> f32 {
        self.meeting.spread_m * self.sight.width_px
    }

    fn patch(&mut self, patch: &Patch<'a>) {
        let Meeting { ahead_m, along_m, look, .. } = *self.meeting;
        let shown_m = self.shown_m().max(1e-6);
        let from_m = patch.from_m.max(along_m - shown_m / 2.0);
        let to_m = patch.to_m.min(along_m + shown_m / 2.0);
        let part = (to_m - from_m) / shown_m;
        if part <= 0.0 {
            return;
        }
        let part = part.min(1.0);
        let row_m = ahead_m / self.sight.focal_px;
        // Between the two sides of what a pixel shows: as sharp as can be without much flicker.
        let spread_m = (row_m * self.meeting.spread_m).sqrt().max(self.meeting.spread_m / 2.5);
        let rows = self.column.between(self.sight.row_px(patch.top_m, ahead_m), self.sight.row_px(patch.foot_m, ahead_m));
        let lit = |height_m: f32| look.light * (LIGHT_AT_FOOT + LIGHT_TO_CEILING * height_m / CEILING_M);
        let heights = rows.map(|(rows_share, row_px, pixel)| (part * rows_share, self.sight.height_m(row_px, ahead_m), pixel));
        match patch.paint {
            Paint::Flat(grey) => heights.for_each(|(share, height_m, pixel)| pixel.cover(share, grey * lit(height_m))),
            Paint::Textured(texture, offset_m, brightness) => {
                let strip = texture.strip(along_m + offset_m, spread_m);
                heights.for_each(|(share, height_m, pixel)| pixel.cover(share, strip.at(height_m) * brightness * lit(height_m)));
            }
        }
    }
}

/// Where in its texture a thing begins, so that it is unlike its neighbours, m.
fn offset_m(mark: u32) -> f32 {
    (mark & 0xFF) as f32 * 0.0371
}
