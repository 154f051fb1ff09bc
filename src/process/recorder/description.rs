//! The preamble of a log, from the settings.

use crate::process::robot;
use anyhow::Result;
use drivelog::Preamble;
use settings::{Settings, Viewer};

/// The preamble of a run with these settings.
///
/// Fails when a path of the settings is not UTF-8.
pub(super) fn describe(run: u64, settings: &Settings) -> Result<Preamble> {
    Ok(Preamble {
        run,
        robot: settings.robot.model.get().name.to_owned(),
        sonars: robot::sonars(&settings.robot),
        origin: format!("recorded by stillmap {} as deployment {}", env!("CARGO_PKG_VERSION"), settings.name),
        // A log is given to others: it must not contain the token of the page.
        settings: Settings { viewer: Viewer::default(), ..settings.clone() }.to_toml()?,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use messages::Pose;

    #[test]
    fn the_sonar_ring_of_the_settings_replaces_that_of_the_model() {
        let mut settings = Settings::default();
        let preamble = describe(1, &settings).unwrap();
        assert_eq!((preamble.robot.as_str(), preamble.sonars.len()), ("pioneer-1", 7));
        assert_eq!(preamble.sonars[1], Pose { x_m: 0.12, y_m: 0.08, yaw_rad: 30f64.to_radians() });
        let text = "name = \"x\"\n[robot]\nmodel = \"p3-dx\"\n[[robot.sonar]]\nx_m = 0.5\ny_m = 0\nheading_deg = -90\n[[process]]\nname = \"r\"\nrun = \"recorder\"\n[[process]]\nname = \"d\"\nrun = \"pioneer\"\n";
        settings = Settings::parse("x.toml", text).unwrap();
        let preamble = describe(1, &settings).unwrap();
        assert_eq!(preamble.robot, "p3-dx");
        assert_eq!(preamble.sonars, [Pose { x_m: 0.5, y_m: 0.0, yaw_rad: -std::f64::consts::FRAC_PI_2 }]);
        assert_eq!(Settings::parse("log", &preamble.settings).unwrap(), settings, "settings in the log");
    }
}
