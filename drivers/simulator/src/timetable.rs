//! Where everything that moves is, as a function of time.

use messages::Pose;

use crate::journey::Journey;
use crate::walker::Walker;
use crate::world::World;

/// The trajectories of a world's robot and walkers, in the world's frame.
#[derive(Debug, Clone)]
pub struct Timetable {
    robot: Journey,
    walkers: Vec<Walker>,
}

impl Timetable {
    /// Of a world.
    #[must_use]
    pub fn of(world: &World) -> Self {
        Self { robot: Journey::of_robot(&world.robot), walkers: world.walkers.iter().map(Walker::new).collect() }
    }

    /// When the robot arrives, s since the start of the drive.
    #[must_use]
    pub fn end_s(&self) -> f64 {
        self.robot.end_s()
    }

    /// Where the robot is at a time, s.
    #[must_use]
    pub fn robot(&self, time_s: f64) -> Pose {
        self.robot.at(time_s).pose
    }

    /// Where the walkers are that are in the world at a time, s: the middle of each body, m, in the order of the file.
    pub fn walkers_m(&self, time_s: f64) -> impl Iterator<Item = [f64; 2]> {
        self.walkers.iter().filter_map(move |walker| walker.stance(time_s)).map(|stance| stance.place.into())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_walkers_in_the_world_have_a_place() {
        let world = "walker = [{ from_m = [0, 1], start_s = 2, speed_m_s = 1, way = [{ to_m = [4, 1] }] }]\n\
                     robot = { start_m = [0, 0], speed_m_s = 0.5, way = [{ to_m = [2, 0] }] }";
        let times = Timetable::of(&document::parse("test", world).unwrap());
        let walkers = |time_s| times.walkers_m(time_s).collect::<Vec<_>>();
        assert_eq!((walkers(1.9), walkers(3.0), walkers(6.1)), (vec![], vec![[1.0, 1.0]], vec![]));
        // The robot stands for a second first.
        assert_eq!((times.robot(3.0).x_m, times.end_s()), (1.0, 5.0));
    }
}
