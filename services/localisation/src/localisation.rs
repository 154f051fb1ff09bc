//! The fold over scans.

use geometry::{MapFromOdom, OdomFromRobot};
use messages::SonarScan;

use crate::answer::{Answer, Smoothed, Status};
use crate::horizon::Horizon;
use crate::parameters::{Parameters, ParametersError};

/// Localisation over a stream of scans.
#[derive(Debug, Clone)]
pub struct Localisation {
    parameters: Parameters,
    pub(crate) horizon: Horizon<[f64; 3]>,
}

impl Localisation {
    /// Before the first scan.
    ///
    /// # Errors
    /// Parameters out of range.
    pub fn new(parameters: Parameters) -> Result<Self, ParametersError> {
        parameters.check()?;
        Ok(Self { parameters, horizon: Horizon::default() })
    }

    /// Where the robot is at this scan, and the poses of the scans that leave the commit horizon with it.
    pub fn step(&mut self, seq: u64, stamp_ns: u64, scan: &SonarScan) -> Answer {
        let odom_from_robot = OdomFromRobot::of_scan(scan);
        self.horizon.push(seq, stamp_ns, [odom_from_robot.x_m, odom_from_robot.y_m, odom_from_robot.yaw_rad]);
        let horizon_ns = self.parameters.horizon_ns;
        let smoothed = std::iter::from_fn(|| self.horizon.pop_older(stamp_ns, horizon_ns)).map(placed).collect();
        Answer { map_from_odom: MapFromOdom::IDENTITY, status: Status::Odometry, smoothed, revision: None }
    }

    /// The last poses, when there are no more scans.
    pub fn finish(&mut self) -> Answer {
        let smoothed = std::iter::from_fn(|| self.horizon.pop()).map(placed).collect();
        Answer { map_from_odom: MapFromOdom::IDENTITY, status: Status::Odometry, smoothed, revision: None }
    }
}

fn placed((seq, [x_m, y_m, yaw_rad]): (u64, [f64; 3])) -> Smoothed {
    Smoothed { seq, map_from_robot: MapFromOdom::IDENTITY.then(&OdomFromRobot::new(x_m, y_m, yaw_rad)), is_placed: true }
}

#[cfg(test)]
mod tests {
    use super::*;
    use messages::Pose;

    fn scan(x_m: f64) -> SonarScan {
        SonarScan::new(Pose::new(x_m, 0.5, -0.25), &[], false)
    }

    #[test]
    fn switched_off_the_map_frame_is_that_of_odometry() {
        let mut localisation = Localisation::new(Parameters::default()).unwrap();
        let mut smoothed = Vec::new();
        for k in 0..100u32 {
            let answer = localisation.step(u64::from(k), u64::from(k) * 100_000_000, &scan(f64::from(k) * 0.03));
            assert_eq!((answer.map_from_odom, answer.status), (MapFromOdom::IDENTITY, Status::Odometry));
            smoothed.extend(answer.smoothed);
            assert_eq!(smoothed.len() as u32, (k + 1).saturating_sub(30), "a scan is answered when it is 3 s old");
        }
        smoothed.extend(localisation.finish().smoothed);
        let expected: Vec<_> = (0..100u32).map(|k| (u64::from(k), Pose::new(f64::from(k) * 0.03, 0.5, -0.25))).collect();
        assert_eq!(smoothed.iter().map(|it| (it.seq, it.map_from_robot.to_wire())).collect::<Vec<_>>(), expected);
        assert!(smoothed.iter().all(|it| it.is_placed));
    }

    #[test]
    fn parameters_out_of_range_are_refused() {
        let error = Localisation::new(Parameters { half_beam_rad: 0.0, ..Parameters::default() }).unwrap_err();
        assert_eq!(error.to_string(), "half_beam_rad is 0, expected 0.01 to 1.5 rad");
    }
}
