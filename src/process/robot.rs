//! The robot of the settings as the protocol crate describes it.

use messages::Pose;
use simulator::Body;

/// Poses of the sonars in the robot frame: those of the settings, or else those of the model.
pub(crate) fn sonars(robot: &settings::Robot) -> Vec<Pose> {
    let own = robot.sonar.iter();
    let own = own.map(|it| Pose { x_m: it.x_m.get(), y_m: it.y_m.get(), yaw_rad: it.heading_deg.get().to_radians() });
    if !robot.sonar.is_empty() {
        return own.collect();
    }
    let mounts = robot.model.get().ring.iter();
    mounts.map(|it| Pose { x_m: it.x_mm / 1e3, y_m: it.y_mm / 1e3, yaw_rad: it.heading_deg.to_radians() }).collect()
}

/// The robot as the simulator needs it.
#[must_use]
pub fn body(robot: &settings::Robot) -> Body {
    Body::of(robot.model.get()).with_ring(&sonars(robot))
}
