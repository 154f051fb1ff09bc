//! What the settings of a deployment mean for FTI.

use ::fti::{Action, Camera, Cue, Magnitude, Parameters, Patience, Rule, Side, Tables};
use messages::Pose;
use settings::{FtiMethod, Pace, Settings};

/// FTI's parameters in a deployment whose clock runs `speed` times faster than the wall's: what a restart or a busy machine delays
/// takes so much more sensor time.
pub(crate) fn parameters(settings: &Settings, speed: f64) -> Parameters {
    let Settings { fti, mapping, robot, .. } = settings;
    let paper = &fti.paper;
    Parameters {
        cell_m: mapping.cell_m.get(),
        half_beam_rad: mapping.half_beam_deg.get().to_radians(),
        range_limit_m: robot.range_limit_m.get(),
        horizon_s: mapping.horizon_s.get(),
        rule: match fti.method {
            FtiMethod::Likelihood => Rule::Likelihood,
            FtiMethod::Paper => Rule::Paper,
        },
        cue: match paper.cue {
            settings::Cue::Ground => Cue::Ground,
            settings::Cue::Paper => Cue::Paper,
        },
        action: match paper.action {
            settings::Action::Withhold => Action::Withhold,
            settings::Action::Free => Action::Free,
        },
        correspond_m: paper.correspond_m.get(),
        prior_log_odds: fti.prior_log_odds.get(),
        camera: settings.expects_camera_motion().then(|| camera(&settings.camera)),
        patience: match settings.pace {
            Pace::Live => Patience::Seconds(fti.patience_s.get() * speed.max(1.0)),
            Pace::Lockstep => Patience::Endless,
        },
        tables: Tables {
            centroid_x: paper.tables.centroid_x.map(|row| row.map(magnitude)),
            centroid_y: paper.tables.centroid_y.map(|row| row.map(side)),
            size: paper.tables.size.map(|row| row.map(magnitude)),
        },
    }
}

fn camera(camera: &settings::Camera) -> Camera {
    let yaw_rad = camera.heading_deg.get().to_radians();
    Camera {
        mount: Pose { x_m: camera.x_m.get(), y_m: camera.y_m.get(), yaw_rad },
        height_m: camera.height_m.get(),
        field_of_view_rad: camera.field_of_view_deg.get().to_radians(),
        horizon_share: camera.horizon_share.get(),
    }
}

fn magnitude(set: settings::Magnitude) -> Magnitude {
    match set {
        settings::Magnitude::VS => Magnitude::VS,
        settings::Magnitude::S => Magnitude::S,
        settings::Magnitude::M => Magnitude::M,
        settings::Magnitude::L => Magnitude::L,
        settings::Magnitude::VL => Magnitude::VL,
    }
}

fn side(set: settings::Side) -> Side {
    match set {
        settings::Side::NB => Side::NB,
        settings::Side::NS => Side::NS,
        settings::Side::Z => Side::Z,
        settings::Side::PS => Side::PS,
        settings::Side::PB => Side::PB,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use ::fti::Fti;

    fn settings(head: &str, tables: &str) -> Settings {
        let text = format!(
            "name = \"x\"\n{head}\nprocess = [{{ name = \"p\", run = \"playback\" }}, {{ name = \"s\", run = \"sbs\" }}, {{ name = \"d\", run = \"std\" }}, \
             {{ name = \"f\", run = \"fti\" }}]\n{tables}"
        );
        Settings::parse("x.toml", &text).unwrap()
    }

    #[test]
    fn default_settings_are_the_default_parameters() {
        let mut settings = Settings { pace: Pace::Lockstep, ..Settings::default() };
        assert_eq!(parameters(&settings, 1.0), Parameters { camera: None, ..Parameters::default() });
        settings.process.push(settings::Process::built_in(settings::BuiltIn::Sbs));
        assert_eq!(parameters(&settings, 1.0), Parameters::default());
    }

    #[test]
    fn live_the_patience_grows_with_the_speed_of_the_clock() {
        let patience = |speed| parameters(&settings("pace = \"live\"", ""), speed).patience;
        assert_eq!([patience(0.5), patience(1.0), patience(4.0)], [0.5, 0.5, 2.0].map(Patience::Seconds));
    }

    #[test]
    fn settings_at_their_limits_make_fti() {
        let low = "[robot]\nrange_limit_m = 0.5\n[mapping]\nhorizon_s = 0\n[fti]\nprior_log_odds = -20\n";
        let high = "[mapping]\nhorizon_s = 10\n[fti]\nprior_log_odds = 20\n";
        let paper = "[fti]\nmethod = \"paper\"\n[fti.paper]\ncorrespond_m = 5\n";
        for numbers in [low, high, paper] {
            Fti::new(parameters(&settings("pace = \"lockstep\"", numbers), 1.0)).unwrap();
        }
    }
}
