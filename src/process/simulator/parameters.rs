//! What the settings of a deployment mean for the simulated camera.

use ::simulator::Optics;
use messages::Pose;

/// The camera that a deployment has.
pub(crate) fn optics(camera: &settings::Camera) -> Optics {
    let yaw_rad = camera.heading_deg.get().to_radians();
    Optics {
        mount: Pose { x_m: camera.x_m.get(), y_m: camera.y_m.get(), yaw_rad },
        height_m: camera.height_m.get(),
        field_of_view_rad: camera.field_of_view_deg.get().to_radians(),
        horizon_share: camera.horizon_share.get(),
        size_px: [camera.width.get(), camera.height.get()],
        interval_ns: (1e9 / camera.rate_hz.get()).round() as u64,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn default_settings_are_the_simulators_defaults() {
        assert_eq!(optics(&settings::Camera::default()), Optics::default());
    }
}
