//! The fold over scans.

use geometry::{MapFromOdom, MapFromRobot};
use messages::{Payload, SonarScan};
use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

use crate::answer::{Answer, Calibration, Closure, Moved, Revision, Smoothed, Status, Wall};
use crate::graph::{Model, is_confirmed};
use crate::horizon::Horizon;
use crate::parameters::{Parameters, ParametersError};
use crate::rigid::Rigid;
use crate::tracking::{Placed, Tracking};

/// Localisation over a stream of scans.
#[derive(Debug, Clone)]
pub struct Localisation {
    pub(crate) parameters: Parameters,
    pub(crate) horizon: Horizon<Waiting>,
    pub(crate) tracking: Tracking,
    /// Revisions answered.
    pub(crate) revisions: u32,
}

/// A scan that was not answered yet: its odometry, and its place in the graph.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, Schema)]
pub(crate) struct Waiting {
    odometry: Rigid,
    placed: Option<Placed>,
}

impl Localisation {
    /// Before the first scan.
    ///
    /// # Errors
    /// Parameters out of range.
    pub fn new(parameters: Parameters) -> Result<Self, ParametersError> {
        parameters.check()?;
        Ok(Self { parameters, horizon: Horizon::default(), tracking: Tracking::default(), revisions: 0 })
    }

    /// Where the robot is at this scan, and the poses of the scans that leave the commit horizon with it. A scan whose numbers are
    /// not valid is answered with its odometry.
    pub fn step(&mut self, seq: u64, stamp_ns: u64, scan: &SonarScan) -> Answer {
        let odometry = Rigid::of(&scan.pose);
        let is_tracked = self.parameters.enabled && scan.validate().is_ok();
        let (placed, moved) = if is_tracked { self.track(seq, scan) } else { (None, None) };
        let now = Waiting { odometry, placed };
        self.horizon.push(seq, stamp_ns, now);
        let horizon_ns = self.parameters.horizon_ns;
        let old: Vec<(u64, Waiting)> = std::iter::from_fn(|| self.horizon.pop_older(stamp_ns, horizon_ns)).collect();
        self.answer(&now, old, moved)
    }

    /// The last poses and the last revision, when there are no more scans.
    pub fn finish(&mut self) -> Answer {
        let moved = self.parameters.enabled.then(|| self.tracking.finish(&self.model()));
        let old: Vec<(u64, Waiting)> = std::iter::from_fn(|| self.horizon.pop()).collect();
        let now = old.last().map_or(Waiting { odometry: Rigid::default(), placed: None }, |(_, last)| *last);
        self.answer(&now, old, moved)
    }

    /// The systematic errors of the odometry, as far as they are known.
    #[must_use]
    pub fn calibration(&self) -> Calibration {
        let found = &self.tracking.graph.estimate.calibration;
        Calibration { distance_share: found.distance, turn_share: found.wheels.turn, curvature_rad_m: found.wheels.curvature }
    }

    /// The walls that were found, in the order of their discovery.
    pub fn walls(&self) -> impl Iterator<Item = Wall> {
        let estimate = &self.tracking.graph.estimate;
        let walls = estimate.lines.iter().filter(|line| line.is_alive() && is_confirmed(line, estimate.direction));
        walls.map(|line| Wall { ends_m: line.wall() })
    }

    /// The places that were recognised, in their order.
    pub fn closures(&self) -> impl Iterator<Item = Closure> {
        let estimate = &self.tracking.graph.estimate;
        let place = |node: u32| estimate.poses.get(node as usize).map_or([0.0; 2], |pose| [pose.x, pose.y]);
        estimate.closures.iter().map(move |it| Closure { earlier_m: place(it.earlier), later_m: place(it.later), weight: it.weight })
    }

    pub(crate) fn model(&self) -> Model {
        Model { right_angles: self.parameters.right_angles, half_beam_rad: self.parameters.half_beam_rad }
    }

    fn track(&mut self, seq: u64, scan: &SonarScan) -> (Option<Placed>, Option<Vec<Moved>>) {
        let (placed, moved) = self.tracking.step(&self.model(), seq, scan);
        (Some(placed), moved)
    }

    fn answer(&mut self, now: &Waiting, old: Vec<(u64, Waiting)>, moved: Option<Vec<Moved>>) -> Answer {
        let revision = moved.filter(|moved| !moved.is_empty()).map(|moved| {
            self.revisions += 1;
            Revision { number: self.revisions, moved }
        });
        let smoothed = old.iter().map(|(seq, waiting)| self.smoothed(*seq, waiting)).collect();
        let (status, map_from_odom) = match now.placed.filter(|_| self.sees_walls()) {
            Some(placed) => (Status::Tracking, self.tracking.pose(&placed).then(&now.odometry.inverse())),
            None => (Status::Odometry, Rigid::default()),
        };
        Answer { map_from_odom: MapFromOdom::from(&map_from_odom), status, smoothed, revision }
    }

    /// Before the first wall nothing is known that odometry does not say.
    fn sees_walls(&self) -> bool {
        !self.tracking.graph.estimate.lines.is_empty()
    }

    fn smoothed(&mut self, seq: u64, waiting: &Waiting) -> Smoothed {
        let pose = match waiting.placed {
            Some(placed) => {
                let pose = self.tracking.graph.estimate.poses.get(placed.node as usize);
                self.tracking.answered.note(placed.node, seq, pose.copied().unwrap_or_default());
                if self.sees_walls() { self.tracking.pose(&placed) } else { waiting.odometry }
            }
            None => waiting.odometry,
        };
        Smoothed { seq, map_from_robot: MapFromRobot::from(&pose), is_placed: true }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use messages::Pose;

    fn scan(x_m: f64) -> SonarScan {
        SonarScan::new(Pose::new(x_m, 0.5, -0.25), &[], false)
    }

    fn answered(enabled: bool) -> Vec<(u64, Pose)> {
        let mut localisation = Localisation::new(Parameters { enabled, ..Parameters::default() }).unwrap();
        let mut smoothed = Vec::new();
        for k in 0..100u32 {
            let answer = localisation.step(u64::from(k), u64::from(k) * 100_000_000, &scan(f64::from(k) * 0.03));
            assert_eq!((answer.map_from_odom, answer.status), (MapFromOdom::IDENTITY, Status::Odometry));
            smoothed.extend(answer.smoothed);
            assert_eq!(smoothed.len() as u32, (k + 1).saturating_sub(30), "a scan is answered when it is 3 s old");
        }
        smoothed.extend(localisation.finish().smoothed);
        assert!(smoothed.iter().all(|it| it.is_placed));
        smoothed.iter().map(|it| (it.seq, it.map_from_robot.to_wire())).collect()
    }

    #[test]
    fn switched_off_the_map_frame_is_that_of_odometry() {
        let expected: Vec<_> = (0..100u32).map(|k| (u64::from(k), Pose::new(f64::from(k) * 0.03, 0.5, -0.25))).collect();
        assert_eq!(answered(false), expected);
    }

    #[test]
    fn without_walls_the_map_frame_is_that_of_odometry() {
        assert_eq!(answered(true), answered(false));
    }

    #[test]
    fn parameters_out_of_range_are_refused() {
        let error = Localisation::new(Parameters { half_beam_rad: 0.0, ..Parameters::default() }).unwrap_err();
        assert_eq!(error.to_string(), "half_beam_rad is 0, expected 0.01 to 1.5 rad");
    }
}
