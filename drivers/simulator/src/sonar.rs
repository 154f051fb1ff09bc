//! What a sonar hears: the first echo of a ping in a beam of rays.
//!
//! A ping goes out in a cone. What comes back first is what the sonar reports:
//!
//! - a face that a ray meets within its critical angle of incidence echoes; beyond it a rough face is silent and a smooth one
//!   is a mirror: the ray continues, and what it meets then echoes along the same path, at its length;
//! - a round thing echoes from the side that faces the sonar;
//! - a corner sends sound straight back, an edge bends a little of it back, nearest only near by.

use messages::Pose;

use crate::geometry::{Circle, Meeting, Ray, Vector, angle, direction, wrapped};
use crate::still::{Face, JointKind, Still};
use crate::world::{self, Surface};

/// Rays over the whole beam: at 12.5° to either side, half a degree apart, 2.6 cm at 3 m.
const RAYS: u32 = 51;

/// A ray gives up after so many mirrors: its echo is lost in the spreading of sound long before.
const MIRRORS: u32 = 3;

/// What stands less than this before a point does not hide it: the point's own faces.
const OWN_FACE_M: f64 = 2e-3;

/// A leg and whose it is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Leg {
    pub(crate) circle: Circle,
    /// Number of the walker, from 1.
    pub(crate) walker: u32,
}

/// What an echo came from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Source {
    Still,
    Walker(u32),
    /// By way of a mirror-like surface; a walker's number where the way ended on one.
    Mirrored(Option<u32>),
}

/// An echo as sound makes it, before noise.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Echo {
    pub(crate) range_m: f64,
    pub(crate) source: Source,
}

/// How the sonars echoes_of, in radians and metres.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Acoustics {
    half_beam_rad: f64,
    limit_m: f64,
    edge_limit_m: f64,
    smooth_critical_rad: f64,
    rough_critical_rad: f64,
}

impl Acoustics {
    pub(crate) fn new(sonar: &world::Sonar, surfaces: &world::Surfaces) -> Self {
        Self {
            half_beam_rad: sonar.half_beam_deg.get().to_radians(),
            limit_m: sonar.limit_m.get(),
            edge_limit_m: sonar.edge_limit_m.get(),
            smooth_critical_rad: surfaces.smooth_critical_deg.get().to_radians(),
            rough_critical_rad: surfaces.rough_critical_deg.get().to_radians(),
        }
    }

    /// The first echo of a ping from `sonar` (in the world's frame), nearer than the limit; `mirrored`: echoes by way of mirrors
    /// are strong enough to be nearest.
    pub(crate) fn first_echo(&self, still: &Still, legs: &[Leg], sonar: &Pose, mirrored: bool) -> Option<Echo> {
        let scene = Scene::around(still, legs, Vector::new(sonar.x_m, sonar.y_m), self.limit_m);
        let beam = (0..RAYS).map(|ray| {
            let share = f64::from(ray) / f64::from(RAYS - 1) * 2.0 - 1.0;
            Ray { origin: scene.sonar, direction: direction(sonar.yaw_rad + share * self.half_beam_rad) }
        });
        let by_ray = beam.filter_map(|ray| self.trace(&scene, ray, mirrored));
        let by_round = scene.rounds().filter_map(|(circle, target)| self.facing_side(&scene, sonar, circle, target));
        let by_joint = still.joints.iter().filter_map(|joint| {
            let range_m = self.visible_point(&scene, sonar, &joint.place)?;
            let nearest = match joint.seen_from(&scene.sonar) {
                JointKind::Corner => true,
                JointKind::Edge => range_m <= self.edge_limit_m,
                JointKind::Flat => false,
            };
            nearest.then_some(Echo { range_m, source: Source::Still })
        });
        by_ray.chain(by_round).chain(by_joint).filter(|echo| echo.range_m < self.limit_m).min_by(|a, b| a.range_m.total_cmp(&b.range_m))
    }

    /// The echo of one ray: straight from a surface, or by way of mirrors.
    fn trace(&self, scene: &Scene<'_>, start: Ray, mirrored: bool) -> Option<Echo> {
        let mut ray = start;
        let mut way_m = 0.0;
        for mirrors in 0..=MIRRORS {
            let (meeting, target) = scene.first_meeting(&ray)?;
            way_m += meeting.distance_m;
            let incidence_rad = (-ray.direction.dot(&meeting.normal)).clamp(-1.0, 1.0).acos();
            let surface = target.surface();
            if incidence_rad <= self.critical_rad(surface) {
                return Some(Echo { range_m: way_m, source: target.source(mirrors > 0) });
            }
            if surface == Surface::Rough || !mirrored || way_m >= self.limit_m {
                return None;
            }
            ray = ray.mirrored(&meeting);
        }
        None
    }

    /// The echo from the side of a round thing that faces the sonar.
    fn facing_side(&self, scene: &Scene<'_>, sonar: &Pose, circle: Circle, target: Target) -> Option<Echo> {
        let towards = circle.centre - scene.sonar;
        let distance_m = towards.norm();
        let range_m = (distance_m - circle.radius_m).max(0.0);
        let place = scene.sonar + towards * (range_m / distance_m.max(f64::MIN_POSITIVE));
        let visible = self.in_beam(sonar, &towards) && scene.sees(&place);
        visible.then_some(Echo { range_m, source: target.source(false) })
    }

    /// Distance of a point that the beam reaches.
    fn visible_point(&self, scene: &Scene<'_>, sonar: &Pose, place: &Vector) -> Option<f64> {
        let towards = place - scene.sonar;
        let range_m = towards.norm();
        (range_m < self.limit_m && self.in_beam(sonar, &towards) && scene.sees(place)).then_some(range_m)
    }

    fn in_beam(&self, sonar: &Pose, towards: &Vector) -> bool {
        wrapped(angle(towards) - sonar.yaw_rad).abs() <= self.half_beam_rad
    }

    fn critical_rad(&self, surface: Surface) -> f64 {
        match surface {
            Surface::Smooth => self.smooth_critical_rad,
            Surface::Rough => self.rough_critical_rad,
        }
    }
}

/// What a ray meets.
#[derive(Debug, Clone, Copy)]
enum Target {
    Still(Surface),
    Walker(u32),
}

impl Target {
    /// Trousers reflect in all directions.
    fn surface(self) -> Surface {
        match self {
            Self::Still(surface) => surface,
            Self::Walker(_) => Surface::Rough,
        }
    }

    fn source(self, mirrored: bool) -> Source {
        match (self, mirrored) {
            (Self::Still(_), false) => Source::Still,
            (Self::Walker(walker), false) => Source::Walker(walker),
            (Self::Still(_), true) => Source::Mirrored(None),
            (Self::Walker(walker), true) => Source::Mirrored(Some(walker)),
        }
    }
}

/// What one ping can meet.
struct Scene<'a> {
    sonar: Vector,
    faces: Vec<&'a Face>,
    still: &'a Still,
    legs: &'a [Leg],
}

impl<'a> Scene<'a> {
    fn around(still: &'a Still, legs: &'a [Leg], sonar: Vector, limit_m: f64) -> Self {
        let faces = still.faces.iter().filter(|face| face.segment.distance_m(&sonar) < limit_m).collect();
        Self { sonar, faces, still, legs }
    }

    fn rounds(&self) -> impl Iterator<Item = (Circle, Target)> {
        let still = self.still.rounds.iter().map(|round| (round.circle, Target::Still(round.surface)));
        still.chain(self.legs.iter().map(|leg| (leg.circle, Target::Walker(leg.walker))))
    }

    fn first_meeting(&self, ray: &Ray) -> Option<(Meeting, Target)> {
        let faces = self.faces.iter().filter_map(|face| Some((ray.meets_segment(&face.segment)?, Target::Still(face.surface))));
        let rounds = self.rounds().filter_map(|(circle, target)| Some((ray.meets_circle(&circle)?, target)));
        faces.chain(rounds).min_by(|a, b| a.0.distance_m.total_cmp(&b.0.distance_m))
    }

    /// Whether nothing stands between the sonar and a place.
    fn sees(&self, place: &Vector) -> bool {
        let towards = place - self.sonar;
        let distance_m = towards.norm();
        if distance_m <= OWN_FACE_M {
            return true;
        }
        let ray = Ray { origin: self.sonar, direction: towards / distance_m };
        self.first_meeting(&ray).is_none_or(|(meeting, _)| meeting.distance_m >= distance_m - OWN_FACE_M)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::world::World;

    const LOOK_EAST: Pose = Pose { x_m: 0.0, y_m: 0.0, yaw_rad: 0.0 };

    fn echoes_of(world: &str, legs: &[Leg], sonar: Pose, mirrored: bool) -> Option<Echo> {
        let world: World = document::parse("test", &format!("robot = {{ start_m = [0, 0], way = [] }}\n{world}")).unwrap();
        Acoustics::new(&world.sonar, &world.surfaces).first_echo(&Still::of(&world), legs, &sonar, mirrored)
    }

    #[track_caller]
    fn check(world: &str, sonar: Pose, mirrored: bool, expect: Option<(f64, Source)>) {
        let nearest = echoes_of(world, &[], sonar, mirrored);
        match (nearest, expect) {
            (None, None) => {}
            (Some(echo), Some((range_m, source))) => {
                assert!((echo.range_m - range_m).abs() < 1e-3, "{echo:?}, expected {range_m}");
                assert_eq!(echo.source, source);
            }
            _ => panic!("{nearest:?}, expected {expect:?}"),
        }
    }

    #[test]
    fn a_wall_straight_ahead_is_at_its_distance() {
        check("wall = [{ along_m = [[2, -3], [2, 3]] }]", LOOK_EAST, true, Some((2.0, Source::Still)));
        check("wall = [{ along_m = [[6, -9], [6, 9]] }]", LOOK_EAST, true, None);
    }

    #[test]
    fn a_wall_within_the_critical_angle_echoes_its_nearest_ray() {
        // Turned by 20°: its foot is outside the beam of 12.5°, the ray nearest to it meets it at 7.5° of incidence.
        let sonar = Pose { yaw_rad: 20f64.to_radians(), ..LOOK_EAST };
        check("wall = [{ along_m = [[2, -3], [2, 3]] }]", sonar, false, Some((2.0 / 7.5f64.to_radians().cos(), Source::Still)));
    }

    #[test]
    fn beyond_the_critical_angle_only_a_rough_wall_echoes() {
        let sonar = Pose { yaw_rad: 45f64.to_radians(), ..LOOK_EAST };
        check("wall = [{ along_m = [[1, -3], [1, 9]] }]", sonar, true, None);
        let nearest = 1.0 / 32.5f64.to_radians().cos();
        check("wall = [{ along_m = [[1, -3], [1, 9]], surface = 'rough' }]", sonar, true, Some((nearest, Source::Still)));
    }

    #[test]
    fn a_mirror_shows_an_object_at_the_length_of_the_folded_path() {
        // The mirror stands at 45° to the axis, one metre ahead; the rough wall one metre above the axis.
        let world = "wall = [{ along_m = [[0.5, -0.5], [1.5, 0.5]] }, { along_m = [[-2, 1.2], [4, 1.2]], surface = 'rough' }]";
        check(world, LOOK_EAST, false, None);
        let echo = echoes_of(world, &[], LOOK_EAST, true).unwrap();
        assert_eq!(echo.source, Source::Mirrored(None));
        assert!((echo.range_m - 2.2).abs() < 0.1, "{echo:?}");
    }

    #[test]
    fn a_corner_of_two_oblique_walls_echoes() {
        let world = "wall = [{ along_m = [[2, 0], [1, 1]] }, { along_m = [[2, 0], [1, -1]] }]";
        check(world, LOOK_EAST, false, Some((2.0, Source::Still)));
        let edge = "wall = [{ along_m = [[2, 0], [3, 1.8]] }, { along_m = [[2, 0], [3, -1.8]] }]\nsonar = { edge_limit_m = 1.9 }";
        check(edge, LOOK_EAST, false, None);
        check(&edge.replace("1.9 }", "2.1 }"), LOOK_EAST, false, Some((2.0, Source::Still)));
    }

    #[test]
    fn a_pillar_echoes_and_hides_what_is_behind() {
        check("pillar = [{ centre_m = [3, 0.2], radius_m = 0.3 }]", LOOK_EAST, false, Some(((9.04f64).sqrt() - 0.3, Source::Still)));
        let hidden = "pillar = [{ centre_m = [1.5, 0], radius_m = 0.6 }]\nwall = [{ along_m = [[2.5, -0.2], [2.5, 0.2]] }]";
        check(hidden, LOOK_EAST, false, Some((0.9, Source::Still)));
    }

    #[test]
    fn a_leg_in_front_of_a_wall_is_the_walkers() {
        let leg = Leg { circle: Circle { centre: Vector::new(1.0, 0.0), radius_m: 0.1 }, walker: 3 };
        let echo = echoes_of("wall = [{ along_m = [[2, -3], [2, 3]] }]", &[leg], LOOK_EAST, false).unwrap();
        assert_eq!(echo.source, Source::Walker(3));
        assert!((echo.range_m - 0.9).abs() < 1e-9);
    }

    #[test]
    fn a_recessed_door_echoes_behind_its_wall() {
        let world = "wall = [{ along_m = [[4, 1], [-4, 1]], door = [{ at_m = 4, width_m = 1, recess_m = 0.25 }] }]";
        let north = |x_m| Pose { x_m, yaw_rad: std::f64::consts::FRAC_PI_2, ..LOOK_EAST };
        check(world, north(0.0), false, Some((1.25, Source::Still)));
        check(world, north(1.5), false, Some((1.0, Source::Still)));
    }
}
