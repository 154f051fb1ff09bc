//! A way through the world in time: stretches at constant speed, turns on the spot, stops.

use messages::Pose;

use crate::geometry::{Vector, angle, wrapped};
use crate::world::{Goal, Robot};

/// How long the robot stands before it sets off: the first packets show a client the start, which is the origin of its map.
pub const STANDSTILL_NS: u64 = 1_000_000_000;

/// A place to go to.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Waypoint {
    pub(crate) place: Vector,
    /// How long to stand there, s.
    pub(crate) stop_s: f64,
}

impl From<&Goal> for Waypoint {
    fn from(goal: &Goal) -> Self {
        Self { place: goal.to_m.vector(), stop_s: goal.stop_s.get() }
    }
}

/// How the heading follows the way.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Turning {
    /// On the spot, at this rate in rad/s.
    OnTheSpot(f64),
    /// With the first step.
    AtOnce,
}

/// Where a traveller is at a time, and how it moves.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Moment {
    pub(crate) pose: Pose,
    pub(crate) speed_m_s: f64,
    /// Counter-clockwise.
    pub(crate) turn_rad_s: f64,
    /// Way covered since the start.
    pub(crate) covered_m: f64,
    /// Way to the nearer of the stand before and the stand ahead: 0 while standing.
    pub(crate) to_stand_m: f64,
}

/// A part of the way in which nothing changes.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Stage {
    start_s: f64,
    end_s: f64,
    from: Pose,
    speed_m_s: f64,
    turn_rad_s: f64,
    covered_m: f64,
}

/// A way in time.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Journey {
    start_s: f64,
    start: Pose,
    stages: Vec<Stage>,
    /// Way covered at each stand, in order, from 0 at the start to all of it at the end.
    stands_m: Vec<f64>,
}

/// Adds stages where the last one ended.
struct Builder {
    clock_s: f64,
    at: Pose,
    covered_m: f64,
    stages: Vec<Stage>,
}

impl Builder {
    fn stage(&mut self, duration_s: f64, speed_m_s: f64, turn_rad_s: f64) {
        if duration_s <= 0.0 {
            return;
        }
        let stage = Stage {
            start_s: self.clock_s,
            end_s: self.clock_s + duration_s,
            from: self.at,
            speed_m_s,
            turn_rad_s,
            covered_m: self.covered_m,
        };
        self.clock_s = stage.end_s;
        self.at = stage.pose(stage.end_s);
        self.covered_m += speed_m_s * duration_s;
        self.stages.push(stage);
    }
}

impl Stage {
    fn pose(&self, time_s: f64) -> Pose {
        let since_s = time_s - self.start_s;
        let (sin, cos) = self.from.yaw_rad.sin_cos();
        let way_m = self.speed_m_s * since_s;
        Pose { x_m: self.from.x_m + cos * way_m, y_m: self.from.y_m + sin * way_m, yaw_rad: self.from.yaw_rad + self.turn_rad_s * since_s }
    }
}

impl Journey {
    /// The way of a world's robot, in the time of the drive.
    pub(crate) fn of_robot(robot: &Robot) -> Self {
        let [x_m, y_m] = robot.start_m.get();
        let start = Pose { x_m, y_m, yaw_rad: robot.heading_deg.get().to_radians() };
        let turning = Turning::OnTheSpot(robot.turn_deg_s.get().to_radians());
        let waypoints: Vec<Waypoint> = robot.path.iter().map(Waypoint::from).collect();
        Self::new(STANDSTILL_NS as f64 * 1e-9, start, robot.speed_m_s.get(), turning, &waypoints)
    }

    /// From `start` at `start_s` through every waypoint, at a constant speed in m/s.
    pub(crate) fn new(start_s: f64, start: Pose, speed_m_s: f64, turning: Turning, waypoints: &[Waypoint]) -> Self {
        let mut path = Builder { clock_s: start_s, at: start, covered_m: 0.0, stages: Vec::new() };
        let mut stands_m = vec![0.0];
        for waypoint in waypoints {
            let onward = waypoint.place - Vector::new(path.at.x_m, path.at.y_m);
            let distance_m = onward.norm();
            if distance_m > 0.0 {
                let turn_rad = wrapped(angle(&onward) - path.at.yaw_rad);
                match turning {
                    Turning::OnTheSpot(rate) => path.stage(turn_rad.abs() / rate, 0.0, rate.copysign(turn_rad)),
                    Turning::AtOnce => path.at.yaw_rad += turn_rad,
                }
                path.stage(distance_m / speed_m_s, speed_m_s, 0.0);
                // The waypoint itself, so that rounding does not add up along the way.
                (path.at.x_m, path.at.y_m) = (waypoint.place.x, waypoint.place.y);
            }
            if waypoint.stop_s > 0.0 {
                path.stage(waypoint.stop_s, 0.0, 0.0);
                stands_m.push(path.covered_m);
            }
        }
        stands_m.push(path.covered_m);
        Self { start_s, start, stages: path.stages, stands_m }
    }

    /// When it begins, s.
    pub(crate) fn start_s(&self) -> f64 {
        self.start_s
    }

    /// When it ends, s.
    pub(crate) fn end_s(&self) -> f64 {
        self.stages.last().map_or(self.start_s, |stage| stage.end_s)
    }

    /// Where the traveller is; before the start at the first place, after the end at the last.
    pub(crate) fn at(&self, time_s: f64) -> Moment {
        let still = |pose, covered_m| Moment { pose, speed_m_s: 0.0, turn_rad_s: 0.0, covered_m, to_stand_m: 0.0 };
        if time_s < self.start_s {
            return still(self.start, 0.0);
        }
        let index = self.stages.partition_point(|stage| stage.end_s <= time_s);
        match (self.stages.get(index), self.stages.last()) {
            (Some(stage), _) => {
                let covered_m = stage.covered_m + stage.speed_m_s * (time_s - stage.start_s);
                Moment {
                    pose: stage.pose(time_s),
                    speed_m_s: stage.speed_m_s,
                    turn_rad_s: stage.turn_rad_s,
                    covered_m,
                    to_stand_m: self.to_stand_m(covered_m),
                }
            }
            (None, Some(last)) => still(last.pose(last.end_s), last.covered_m + last.speed_m_s * (last.end_s - last.start_s)),
            (None, None) => still(self.start, 0.0),
        }
    }

    fn to_stand_m(&self, covered_m: f64) -> f64 {
        self.stands_m.iter().map(|stand_m| (stand_m - covered_m).abs()).fold(f64::INFINITY, f64::min)
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::FRAC_PI_2;

    use super::*;

    fn waypoint(x: f64, y: f64, stop_s: f64) -> Waypoint {
        Waypoint { place: Vector::new(x, y), stop_s }
    }

    fn near(moment: Moment, x_m: f64, y_m: f64, yaw_rad: f64) {
        let pose = moment.pose;
        let off = (pose.x_m - x_m).abs() + (pose.y_m - y_m).abs() + (pose.yaw_rad - yaw_rad).abs();
        assert!(off < 1e-9, "{pose:?}, expected ({x_m}, {y_m}, {yaw_rad})");
    }

    #[test]
    fn it_drives_stops_turns_and_drives_on() {
        let path = [waypoint(2.0, 0.0, 3.0), waypoint(2.0, 1.0, 0.0)];
        let journey = Journey::new(0.0, Pose::default(), 0.5, Turning::OnTheSpot(FRAC_PI_2), &path);
        near(journey.at(2.0), 1.0, 0.0, 0.0);
        near(journey.at(5.0), 2.0, 0.0, 0.0);
        near(journey.at(7.5), 2.0, 0.0, FRAC_PI_2 / 2.0);
        near(journey.at(9.0), 2.0, 0.5, FRAC_PI_2);
        near(journey.at(99.0), 2.0, 1.0, FRAC_PI_2);
        assert!((journey.end_s() - 10.0).abs() < 1e-9);
        assert!((journey.at(7.5).turn_rad_s - FRAC_PI_2).abs() < 1e-9);
        assert!((journey.at(2.0).speed_m_s - 0.5).abs() < 1e-9);
    }

    #[test]
    fn it_turns_the_short_way() {
        let path = [waypoint(0.0, -1.0, 0.0)];
        let journey = Journey::new(0.0, Pose::default(), 1.0, Turning::OnTheSpot(1.0), &path);
        assert!(journey.at(0.5).turn_rad_s < 0.0);
        near(journey.at(FRAC_PI_2 + 0.5), 0.0, -0.5, -FRAC_PI_2);
    }

    #[test]
    fn way_from_the_nearest_stand() {
        let path = [waypoint(2.0, 0.0, 1.0), waypoint(5.0, 0.0, 0.0)];
        let journey = Journey::new(4.0, Pose::default(), 1.0, Turning::AtOnce, &path);
        for (time_s, expected_m) in [(0.0, 0.0), (4.5, 0.5), (5.5, 0.5), (6.5, 0.0), (8.5, 1.5), (9.5, 0.5), (11.0, 0.0)] {
            assert!((journey.at(time_s).to_stand_m - expected_m).abs() < 1e-9, "{time_s}");
        }
        assert!((journey.at(99.0).covered_m - 5.0).abs() < 1e-9);
    }
}
