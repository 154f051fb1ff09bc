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
