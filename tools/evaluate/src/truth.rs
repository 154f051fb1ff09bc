//! The true surfaces and the walkers' paths, in the frame of the map.

use std::collections::BTreeSet;

use geometry::{Cell, CellSize};
use messages::{Pose, TruthSurfaces};

use crate::scan::Scan;

/// Distance of neighbouring places on a surface, m.
const STEP_M: f64 = 0.02;

/// The true surfaces and the walkers' paths, in the frame of the map.
#[derive(Debug, Clone, Default)]
pub struct Truth {
    /// Both ends of each straight piece of surface, m.
    pub surfaces_m: Vec<[[f64; 2]; 2]>,
    /// Every place of a walker, m.
    pub paths_m: Vec<[f64; 2]>,
    /// Places at which a walker stood for a second, m.
    pub stands_m: Vec<[f64; 2]>,
    /// The paths of the walkers, one after the other, m.
    pub walkers_m: Vec<Vec<[f32; 2]>>,
}

/// Packets of a second and one.
const STAND_PACKETS: usize = 11;
/// A walker that moves less in a second stands, m.
pub(crate) const STANDS_M: f64 = 0.15;
/// Farthest that a walker moves between two packets, m.
const LEAP_M: f64 = 0.6;

impl Truth {
    pub(crate) fn new(surfaces: &[TruthSurfaces], scans: &[Scan]) -> Self {
        let Some(start) = surfaces.first().map(|chunk| chunk.start) else { return Self::default() };
        let pieces = surfaces.iter().flat_map(|chunk| &chunk.surfaces[..chunk.count as usize]);
        let surfaces_m = pieces.map(|piece| [in_map(&start, piece.from_m), in_map(&start, piece.to_m)]).collect();
        let walkers_m = paths(&start, scans);
        let places = |path: &Vec<[f32; 2]>| path.iter().map(|place| place.map(f64::from)).collect::<Vec<_>>();
        let all: Vec<Vec<[f64; 2]>> = walkers_m.iter().map(places).collect();
        let stands_m = all.iter().flat_map(|path| stands(path)).collect();
        Self { surfaces_m, paths_m: all.concat(), stands_m, walkers_m }
    }

    /// Places on the surfaces, a step apart.
    pub(crate) fn surface_places_m(&self) -> impl Iterator<Item = [f64; 2]> {
        self.surfaces_m.iter().flat_map(|[from, to]| {
            let steps = ((to[0] - from[0]).hypot(to[1] - from[1]) / STEP_M).ceil().max(1.0) as u32;
            (0..=steps).map(move |step| {
                let share = f64::from(step) / f64::from(steps);
                [from[0] + share * (to[0] - from[0]), from[1] + share * (to[1] - from[1])]
            })
        })
    }
}

/// The paths of the walkers. A walker that comes or goes changes the places in the list, which begins a new path.
fn paths(start: &Pose, scans: &[Scan]) -> Vec<Vec<[f32; 2]>> {
    let mut paths: Vec<Vec<[f32; 2]>> = Vec::new();
    for number in 0..messages::MAX_TRUE_WALKERS {
        let mut last: Option<[f64; 2]> = None;
        for scan in scans {
            let places = &scan.truth.walkers_m[..scan.truth.walkers_count as usize];
            let place = places.get(number).map(|place| in_map(start, *place));
            if let Some(place) = place {
                let is_continued = last.is_some_and(|last| (place[0] - last[0]).hypot(place[1] - last[1]) < LEAP_M);
                if !is_continued {
                    paths.push(Vec::new());
                }
                paths.last_mut().into_iter().for_each(|path| path.push(place.map(|number| number as f32)));
            }
            last = place;
        }
    }
    paths
}

/// Where a walker stands. At the first place of its path it is not in the world yet.
fn stands(path: &[[f64; 2]]) -> impl Iterator<Item = [f64; 2]> {
    let present = path.iter().position(|place| Some(place) != path.first()).unwrap_or(path.len());
    path[present..].windows(STAND_PACKETS).filter_map(|places| {
        let (from, to) = (places.first()?, places.last()?);
        ((to[0] - from[0]).hypot(to[1] - from[1]) < STANDS_M).then_some(*to)
    })
}

/// A place of the world's frame in the map's, whose origin is the robot's start.
pub(crate) fn in_map(start: &Pose, place_m: [f64; 2]) -> [f64; 2] {
    let (sin, cos) = start.yaw_rad.sin_cos();
    let (dx, dy) = (place_m[0] - start.x_m, place_m[1] - start.y_m);
    [dx * cos + dy * sin, dy * cos - dx * sin]
}

/// The cells whose centres lie within a distance of any of these places.
pub(crate) fn cells_near(size: CellSize, places_m: impl Iterator<Item = [f64; 2]>, within_m: f64) -> BTreeSet<Cell> {
    let mut near = BTreeSet::new();
    let mut done = BTreeSet::new();
    for [x, y] in places_m {
        // Places closer than a centimetre to one that was looked at add nothing.
        if !done.insert(((x * 100.0) as i64, (y * 100.0) as i64)) {
            continue;
        }
        for row in size.index_of(y - within_m)..=size.index_of(y + within_m) {
            for column in size.index_of(x - within_m)..=size.index_of(x + within_m) {
                if (size.centre_of(column) - x).hypot(size.centre_of(row) - y) <= within_m {
                    near.insert(Cell { row, column });
                }
            }
        }
    }
    near
}
