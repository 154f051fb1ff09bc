//! The robot of the settings as the protocol crate describes it.

use anyhow::{Context, Result};
use messages::Pose;
use psos::Model;

/// The model of the robot.
pub(super) fn model(setting: settings::Model) -> Result<&'static Model> {
    let name = match setting {
        settings::Model::Pioneer1 => "pioneer-1",
        settings::Model::PioneerAt => "pioneer-at",
        settings::Model::P2Dx => "p2-dx",
        settings::Model::P3Dx => "p3-dx",
    };
    Model::named(name).with_context(|| format!("robot.model: {name} is not known"))
}

/// Poses of the sonars in the robot frame: those of the settings, or else those of the model.
pub(super) fn sonars(robot: &settings::Robot) -> Result<Vec<Pose>> {
    let own = robot.sonar.iter();
    let own = own.map(|it| Pose { x_m: it.x_m.get(), y_m: it.y_m.get(), yaw_rad: it.heading_deg.get().to_radians() });
    if !robot.sonar.is_empty() {
        return Ok(own.collect());
    }
    let mounts = model(robot.model)?.ring.iter();
    Ok(mounts.map(|it| Pose { x_m: it.x_mm / 1e3, y_m: it.y_mm / 1e3, yaw_rad: it.heading_deg.to_radians() }).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_model_of_the_settings_is_known() {
        for (setting, name) in [
            (settings::Model::Pioneer1, "pioneer-1"),
            (settings::Model::PioneerAt, "pioneer-at"),
            (settings::Model::P2Dx, "p2-dx"),
            (settings::Model::P3Dx, "p3-dx"),
        ] {
            assert_eq!(model(setting).unwrap().name, name);
        }
    }
}
