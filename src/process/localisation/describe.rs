//! The estimate in words.

use ::localisation::{Answer, Calibration, Facts, Revision, Status};
use geometry::{MapFromOdom, OdomFromRobot, wrapped};
use messages::SonarScan;

/// A revision that moves nothing by so much changes no picture that people look at, m.
const WORTH_A_LINE_M: f64 = 0.1;

/// The state of the estimate, for `stillmap status` and the page.
pub(super) fn note(status: Status, facts: &Facts) -> String {
    match status {
        Status::Odometry => "by odometry: no wall yet".to_owned(),
        Status::Lost => "lost: the robot was moved".to_owned(),
        Status::Tracking => format!("{}; {} walls, {} places recognised", calibration(&facts.calibration), facts.walls, facts.closures),
    }
}

fn calibration(found: &Calibration) -> String {
    format!("wheels count {} far, turn {} much", share(found.distance_share), share(found.turn_share))
}

/// 0.021 is "2.1 % too", −0.021 is "−2.1 % too".
fn share(share: f64) -> String {
    format!("{:.1} % too", 100.0 * share)
}

/// How far odometry is from the estimate.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Drift {
    pub(super) distance_m: f64,
    pub(super) turn_deg: f64,
}

impl Drift {
    pub(super) fn of(map_from_odom: &MapFromOdom, scan: &SonarScan) -> Self {
        let odom_from_robot = OdomFromRobot::of_scan(scan);
        let map_from_robot = map_from_odom.then(&odom_from_robot);
        let distance_m = (map_from_robot.x_m - odom_from_robot.x_m).hypot(map_from_robot.y_m - odom_from_robot.y_m);
        Self { distance_m, turn_deg: wrapped(map_from_odom.yaw_rad).abs().to_degrees() }
    }

    /// The last line of a drive.
    pub(super) fn line(&self, facts: &Facts) -> String {
        let Self { distance_m, turn_deg } = self;
        format!(
            "odometry was off by {distance_m:.2} m and {turn_deg:.1}° at the end; {}; {} places recognised",
            calibration(&facts.calibration),
            facts.closures
        )
    }
}

/// What is logged of an answer, if anything.
pub(super) fn news(before: Status, answer: &Answer) -> Option<String> {
    match (before, answer.status) {
        (Status::Odometry, Status::Tracking) => Some("the first wall is found: poses follow from odometry and walls".to_owned()),
        (Status::Odometry | Status::Tracking, Status::Lost) => {
            Some("lost: something moved the robot; scans enter the map once its place is recognised".to_owned())
        }
        (Status::Lost, Status::Tracking) => Some("found: the place of the robot is recognised".to_owned()),
        _ => answer.revision.as_ref().and_then(revised),
    }
}

fn revised(revision: &Revision) -> Option<String> {
    let shift_m = |it: &::localisation::Moved| (it.now.x_m - it.before.x_m).hypot(it.now.y_m - it.before.y_m);
    let largest_m = revision.moved.iter().map(shift_m).fold(0.0, f64::max);
    (largest_m >= WORTH_A_LINE_M).then(|| format!("map revised: earlier poses move by up to {largest_m:.2} m"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use ::localisation::Moved;
    use geometry::MapFromRobot;
    use messages::Pose;

    fn facts() -> Facts {
        let calibration = Calibration { distance_share: 0.021, turn_share: -0.04, ..Calibration::default() };
        Facts { calibration, walls: 12, closures: 3 }
    }

    #[test]
    fn the_note_names_calibration_walls_and_places() {
        assert_eq!(note(Status::Odometry, &facts()), "by odometry: no wall yet");
        assert_eq!(note(Status::Tracking, &facts()), "wheels count 2.1 % too far, turn -4.0 % too much; 12 walls, 3 places recognised");
    }

    #[test]
    fn the_last_line_says_how_far_odometry_was_off() {
        let scan = SonarScan::new(Pose::new(3.0, 0.0, 0.0), &[], false);
        let drift = Drift::of(&MapFromOdom::new(3.0, 3.0, std::f64::consts::FRAC_PI_2), &scan);
        assert!((drift.distance_m - 6.0).abs() < 1e-9 && (drift.turn_deg - 90.0).abs() < 1e-9, "{drift:?}");
        let expected =
            "odometry was off by 6.00 m and 90.0° at the end; wheels count 2.1 % too far, turn -4.0 % too much; 3 places recognised";
        assert_eq!(drift.line(&facts()), expected);
    }

    #[test]
    fn a_large_revision_and_a_lost_robot_are_logged() {
        let answer = |status, shift_m: f64| {
            let moved = vec![Moved { first: 1, last: 2, before: MapFromRobot::IDENTITY, now: MapFromRobot::new(shift_m, 0.0, 0.0) }];
            let revision = (shift_m > 0.0).then_some(Revision { number: 1, moved });
            Answer { map_from_odom: MapFromOdom::IDENTITY, status, smoothed: Vec::new(), revision }
        };
        let line = |before, status, shift_m| news(before, &answer(status, shift_m)).unwrap_or_default();
        assert_eq!(line(Status::Tracking, Status::Tracking, 0.05), "");
        assert_eq!(line(Status::Tracking, Status::Tracking, 0.25), "map revised: earlier poses move by up to 0.25 m");
        assert!(line(Status::Tracking, Status::Lost, 0.0).starts_with("lost"));
        assert!(line(Status::Lost, Status::Tracking, 0.0).starts_with("found"));
        assert!(line(Status::Odometry, Status::Tracking, 0.0).starts_with("the first wall"));
    }
}
