//! The preamble of a log, from the settings.

use drivelog::Preamble;
use messages::Pose;
use settings::{Settings, SettingsError, Viewer};

/// The preamble of a run with these settings.
/// Fails when a path of the settings is not UTF-8.
pub(super) fn describe(run: u64, settings: &Settings) -> Result<Preamble, SettingsError> {
    let model = model(settings.robot.model);
    let own = settings.robot.sonar.iter();
    let own = own.map(|sonar| (sonar.x_m.get(), sonar.y_m.get(), sonar.heading_deg.get()));
    let models = model.ring.iter().map(|mount| (mount.x_mm * 1e-3, mount.y_mm * 1e-3, mount.heading_deg));
    let ring: Vec<_> = if settings.robot.sonar.is_empty() { models.collect() } else { own.collect() };
    Ok(Preamble {
        run,
        robot: model.name.to_owned(),
        sonars: ring.into_iter().map(|(x_m, y_m, deg): (f64, f64, f64)| Pose { x_m, y_m, yaw_rad: deg.to_radians() }).collect(),
        origin: format!("recorded by stillmap {} as deployment {}", env!("CARGO_PKG_VERSION"), settings.name),
        // A log is given to others: it must not contain the token of the page.
        settings: Settings { viewer: Viewer::default(), ..settings.clone() }.to_toml()?,
    })
}

fn model(setting: settings::Model) -> &'static psos::Model {
    let name = match setting {
        settings::Model::Pioneer1 => "pioneer-1",
        settings::Model::PioneerAt => "pioneer-at",
        settings::Model::P2Dx => "p2-dx",
        settings::Model::P3Dx => "p3-dx",
    };
    psos::Model::named(name).unwrap_or(&psos::MODELS[0])
}

#[cfg(test)]
mod tests {
    use super::*;

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
