//! Straight pieces and circles in the plane, and where a ray meets them.
//!
//! Lengths in metres, angles in radians, in the world's frame (right-handed).

/// A place or a direction in the plane.
pub(crate) type Vector = nalgebra::Vector2<f64>;

/// What is nearer than this to a ray's origin is the surface it has just left.
const DEPARTURE_M: f64 = 1e-6;

/// A straight piece of a surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Segment {
    pub(crate) from: Vector,
    pub(crate) to: Vector,
}

/// A round thing, seen from above.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Circle {
    pub(crate) centre: Vector,
    pub(crate) radius_m: f64,
}

/// A straight way of sound.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Ray {
    pub(crate) origin: Vector,
    /// Of length 1.
    pub(crate) direction: Vector,
}

/// Where a ray meets a surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Meeting {
    /// From the ray's origin.
    pub(crate) distance_m: f64,
    /// Of length 1, on the side that the ray comes from.
    pub(crate) normal: Vector,
}

/// The direction at an angle from x.
pub(crate) fn direction(angle_rad: f64) -> Vector {
    Vector::new(angle_rad.cos(), angle_rad.sin())
}

/// The angle of a direction, in (−π, π].
pub(crate) fn angle(direction: &Vector) -> f64 {
    direction.y.atan2(direction.x)
}

/// An angle brought into [−π, π).
pub(crate) fn wrapped(angle_rad: f64) -> f64 {
    (angle_rad + std::f64::consts::PI).rem_euclid(std::f64::consts::TAU) - std::f64::consts::PI
}

impl Segment {
    /// Distance of a place from the piece.
    pub(crate) fn distance_m(&self, place: &Vector) -> f64 {
        let along = self.to - self.from;
        let length_squared = along.norm_squared();
        if length_squared == 0.0 {
            return (place - self.from).norm();
        }
        let share = ((place - self.from).dot(&along) / length_squared).clamp(0.0, 1.0);
        (place - (self.from + along * share)).norm()
    }

    /// Whether two pieces have a place in common.
    pub(crate) fn crosses(&self, other: &Segment) -> bool {
        let length_m = (self.to - self.from).norm();
        if length_m == 0.0 {
            return other.distance_m(&self.from) == 0.0;
        }
        let ray = Ray { origin: self.from, direction: (self.to - self.from) / length_m };
        ray.meets_segment(other).is_some_and(|meeting| meeting.distance_m <= length_m)
    }
}

impl Ray {
    /// Where the ray meets a straight piece, if it does; a ray along the piece does not.
    pub(crate) fn meets_segment(&self, segment: &Segment) -> Option<Meeting> {
        let along = segment.to - segment.from;
        let across = Vector::new(-along.y, along.x);
        let closing = self.direction.dot(&across);
        let length_m = along.norm();
        if closing.abs() <= 1e-12 * length_m {
            return None;
        }
        let towards = segment.from - self.origin;
        let distance_m = towards.dot(&across) / closing;
        let place = self.direction * distance_m - towards;
        let share = place.dot(&along) / (length_m * length_m);
        if distance_m <= DEPARTURE_M || !(0.0..=1.0).contains(&share) {
            return None;
        }
        let normal = across / length_m;
        Some(Meeting { distance_m, normal: if closing > 0.0 { -normal } else { normal } })
    }

    /// Where the ray enters a circle, if it does; one that starts inside does not.
    pub(crate) fn meets_circle(&self, circle: &Circle) -> Option<Meeting> {
        let towards = circle.centre - self.origin;
        let along_m = towards.dot(&self.direction);
        let beside_squared = towards.norm_squared() - along_m * along_m;
        let half_chord_squared = circle.radius_m * circle.radius_m - beside_squared;
        if half_chord_squared < 0.0 {
            return None;
        }
        let distance_m = along_m - half_chord_squared.sqrt();
        if distance_m <= DEPARTURE_M {
            return None;
        }
        let normal = (self.direction * distance_m - towards) / circle.radius_m;
        Some(Meeting { distance_m, normal })
    }

    /// The way on after a mirror-like reflection.
    pub(crate) fn mirrored(&self, meeting: &Meeting) -> Ray {
        Ray {
            origin: self.origin + self.direction * meeting.distance_m,
            direction: self.direction - meeting.normal * (2.0 * self.direction.dot(&meeting.normal)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ray(x: f64, y: f64, angle_rad: f64) -> Ray {
        Ray { origin: Vector::new(x, y), direction: direction(angle_rad) }
    }

    #[test]
    fn a_ray_meets_a_segment_with_the_normal_towards_it() {
        let wall = Segment { from: Vector::new(2.0, -1.0), to: Vector::new(2.0, 1.0) };
        let meeting = ray(0.0, 0.0, 0.0).meets_segment(&wall).unwrap();
        assert!((meeting.distance_m - 2.0).abs() < 1e-12);
        assert!((meeting.normal - Vector::new(-1.0, 0.0)).norm() < 1e-12);
        let behind = ray(4.0, 0.0, std::f64::consts::PI).meets_segment(&wall).unwrap();
        assert!((behind.normal - Vector::new(1.0, 0.0)).norm() < 1e-12);
        assert_eq!(ray(0.0, 0.0, 0.6).meets_segment(&wall), None);
        assert_eq!(ray(0.0, 0.0, std::f64::consts::PI).meets_segment(&wall), None);
    }

    #[test]
    fn a_ray_meets_the_near_side_of_a_circle() {
        let pillar = Circle { centre: Vector::new(3.0, 0.0), radius_m: 0.5 };
        let meeting = ray(0.0, 0.0, 0.0).meets_circle(&pillar).unwrap();
        assert!((meeting.distance_m - 2.5).abs() < 1e-12);
        assert!((meeting.normal - Vector::new(-1.0, 0.0)).norm() < 1e-12);
        assert_eq!(ray(0.0, 0.6, 0.0).meets_circle(&pillar), None);
    }

    #[test]
    fn a_mirrored_ray_leaves_at_the_angle_it_came() {
        let floor = Segment { from: Vector::new(0.0, 0.0), to: Vector::new(4.0, 0.0) };
        let coming = ray(0.0, 1.0, -std::f64::consts::FRAC_PI_4);
        let going = coming.mirrored(&coming.meets_segment(&floor).unwrap());
        assert!((going.origin - Vector::new(1.0, 0.0)).norm() < 1e-12);
        assert!((going.direction - direction(std::f64::consts::FRAC_PI_4)).norm() < 1e-12);
    }

    #[test]
    fn pieces_cross_where_they_share_a_place() {
        let path = Segment { from: Vector::new(0.0, 0.0), to: Vector::new(2.0, 0.0) };
        let across = |x: f64| Segment { from: Vector::new(x, -1.0), to: Vector::new(x, 1.0) };
        assert!(path.crosses(&across(1.0)));
        assert!(!path.crosses(&across(3.0)));
        assert!((across(3.0).distance_m(&Vector::new(2.0, 2.0)) - 2f64.sqrt()).abs() < 1e-12);
    }
}
