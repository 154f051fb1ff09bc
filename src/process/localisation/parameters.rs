//! What the settings of a deployment mean for localisation.

use ::localisation::{Parameters, RightAngles};
use settings::Settings;

/// Localisation's parameters in a deployment with these settings.
pub(crate) fn parameters(settings: &Settings) -> Parameters {
    Parameters {
        enabled: true,
        right_angles: match settings.localisation.right_angles {
            settings::RightAngles::Auto => RightAngles::Auto,
            settings::RightAngles::On => RightAngles::On,
            settings::RightAngles::Off => RightAngles::Off,
        },
        half_beam_rad: settings.mapping.half_beam_deg.get().to_radians(),
        horizon_ns: (settings.mapping.horizon_s.get() * 1e9) as u64,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn default_settings_are_the_default_parameters() {
        assert_eq!(parameters(&Settings::default()), Parameters { enabled: true, ..Parameters::default() });
    }
}
