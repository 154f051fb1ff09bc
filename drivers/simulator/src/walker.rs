//! People: a way through the world and two legs that step along it.

use messages::Pose;

use crate::geometry::{Circle, Vector, angle, direction};
use crate::journey::{Journey, Moment, Turning, Waypoint};
use crate::world;

/// Height of the walker that the lengths below are those of, m.
const HEIGHT_M: f64 = 1.7;

/// Radius of a trousered shin at the height of the sonars, m.
const LEG_RADIUS_M: f64 = 0.07;

/// Each leg's distance to the side of the body's middle, m.
pub(crate) const HALF_STANCE_M: f64 = 0.09;

/// A person on two legs.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Walker {
    journey: Journey,
    step_m: f64,
    /// Factor on every length of the body.
    scale: f64,
}

/// How a walker stands in the middle of a step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Stance {
    /// The middle of the body.
    pub(crate) place: Vector,
    /// Which way it faces, of length 1.
    pub(crate) ahead: Vector,
    /// How far the left leg is before the body, and the right one behind it.
    pub(crate) stride_m: f64,
    /// The farthest that it gets in this step: 0 while standing.
    pub(crate) reach_m: f64,
    /// Whether the left leg is in the air; otherwise the right one is, unless the walker stands.
    pub(crate) left_swings: bool,
    /// Size of the body against one of 1.7 m.
    pub(crate) scale: f64,
}

impl Walker {
    pub(crate) fn new(walker: &world::Walker) -> Self {
        let from = walker.from_m.vector();
        let waypoints: Vec<Waypoint> = walker.path.iter().map(Waypoint::from).collect();
        let onward = waypoints.first().map_or(Vector::zeros(), |first| first.place - from);
        let start = Pose { x_m: from.x, y_m: from.y, yaw_rad: angle(&onward) };
        let journey = Journey::new(walker.start_s.get(), start, walker.speed_m_s.get(), Turning::AtOnce, &waypoints);
        Self { journey, step_m: walker.step_m.get(), scale: walker.height_m.get() / HEIGHT_M }
    }

    /// The middle of the body; of a walker who has not come yet or has left, the nearer end of the way.
    pub(crate) fn place(&self, time_s: f64) -> Vector {
        let pose = self.journey.at(time_s).pose;
        Vector::new(pose.x_m, pose.y_m)
    }

    /// The two legs, left and right; `None` while the walker is not in the world.
    pub(crate) fn legs(&self, time_s: f64) -> Option<[Circle; 2]> {
        let Stance { place, ahead, stride_m, scale, .. } = self.stance(time_s)?;
        let left = Vector::new(-ahead.y, ahead.x) * (HALF_STANCE_M * scale);
        let stride = ahead * stride_m;
        Some([place + left + stride, place - left - stride].map(|centre| Circle { centre, radius_m: LEG_RADIUS_M * scale }))
    }

    /// How the walker stands; `None` while the walker is not in the world.
    ///
    /// In each step one foot stands on the ground while the other swings past it at twice the body's speed: in the body's
    /// frame both move at the body's speed, one back, one forward. Feet draw together towards every stop.
    pub(crate) fn stance(&self, time_s: f64) -> Option<Stance> {
        if time_s < self.journey.start_s() || time_s >= self.journey.end_s() {
            return None;
        }
        let Moment { pose, covered_m, to_stand_m, .. } = self.journey.at(time_s);
        let phase = (covered_m / (2.0 * self.step_m)).fract();
        let swing = 4.0 * (phase - 0.5).abs() - 1.0;
        let reach_m = (self.step_m / 2.0).min(to_stand_m);
        let left_swings = phase > 0.5;
        Some(Stance {
            place: Vector::new(pose.x_m, pose.y_m),
            ahead: direction(pose.yaw_rad),
            stride_m: swing * reach_m,
            reach_m,
            left_swings,
            scale: self.scale,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn walker() -> Walker {
        let walker = "from_m = [0, 0]\nstart_s = 2\nspeed_m_s = 1\nstep_m = 0.5\nway = [{ to_m = [4, 0], stop_s = 3 }, { to_m = [4, 4] }]";
        Walker::new(&document::parse("test", walker).unwrap())
    }

    #[test]
    fn in_the_world_from_the_start_to_the_end_of_the_way() {
        let walker = walker();
        assert_eq!(walker.legs(1.99), None);
        assert!(walker.legs(2.0).is_some());
        assert!(walker.legs(12.9).is_some());
        assert_eq!(walker.legs(13.1), None);
        assert!((walker.place(0.0) - Vector::new(0.0, 0.0)).norm() < 1e-9);
        assert!((walker.place(99.0) - Vector::new(4.0, 4.0)).norm() < 1e-9);
    }

    #[test]
    fn one_foot_stands_while_the_other_swings_at_twice_the_speed() {
        let walker = walker();
        let mut stood = 0;
        for step in 0..20 {
            // From 1 m to 3 m of way: strides are full there.
            let time_s = 3.005 + f64::from(step) * 0.1;
            let (before, after) = (walker.legs(time_s).unwrap(), walker.legs(time_s + 0.01).unwrap());
            let speeds: Vec<f64> = (0..2).map(|leg| (after[leg].centre - before[leg].centre).norm() / 0.01).collect();
            let (slow, fast) = (speeds[0].min(speeds[1]), speeds[0].max(speeds[1]));
            if slow < 1e-6 && (fast - 2.0).abs() < 1e-6 {
                stood += 1;
            }
        }
        assert!(stood >= 18, "{stood} of 20: the rest may be the moments at which the feet change");
    }

    #[test]
    fn legs_are_in_proportion_to_the_height() {
        let walker = "from_m = [0, 0]\nheight_m = 0.85\nway = [{ to_m = [4, 0], stop_s = 3 }]";
        let [left, right] = Walker::new(&document::parse("test", walker).unwrap()).legs(5.0).unwrap();
        assert!(((left.centre - right.centre).norm() - HALF_STANCE_M).abs() < 1e-9, "{left:?} {right:?}");
        assert!((left.radius_m - LEG_RADIUS_M / 2.0).abs() < 1e-9, "{left:?}");
    }

    #[test]
    fn feet_are_together_at_a_stop() {
        let [left, right] = walker().legs(7.0).unwrap();
        assert!((left.centre - Vector::new(4.0, HALF_STANCE_M)).norm() < 1e-9, "{left:?}");
        assert!((right.centre - Vector::new(4.0, -HALF_STANCE_M)).norm() < 1e-9, "{right:?}");
    }
}
