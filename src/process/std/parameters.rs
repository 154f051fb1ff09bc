//! What the settings of a deployment mean for STD.

use settings::{MovingCell, Settings};
use stillmap_std::{Parameters, Rule};

/// STD's parameters in a deployment with these settings.
pub(crate) fn parameters(settings: &Settings) -> Parameters {
    let Settings { std, mapping, .. } = settings;
    Parameters {
        cell_m: mapping.cell_m.get(),
        half_beam_rad: mapping.half_beam_deg.get().to_radians(),
        rule: match std.rule {
            MovingCell::Visible => Rule::Visible,
            MovingCell::Paper => Rule::Paper,
        },
        span_scans: std.span_scans.get(),
        tolerance_cells: std.tolerance_cells.get(),
        moving_share: std.moving_share.get(),
        free_for_scans: std.free_for_scans.get(),
        aside_rad: std.aside_deg.get().to_radians(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use stillmap_std::Std;

    #[test]
    fn default_settings_are_the_default_parameters() {
        assert_eq!(parameters(&Settings::default()), Parameters::default());
    }

    #[test]
    fn settings_at_their_limits_make_std() {
        let low = "span_scans = 1\ntolerance_cells = 0\nmoving_share = 0\nfree_for_scans = 1\naside_deg = 0\n";
        let high = "rule = \"paper\"\nspan_scans = 100\ntolerance_cells = 5\nmoving_share = 1\naside_deg = 180\n";
        for numbers in [low, high] {
            let text = format!(
                "name = \"x\"\n[std]\n{numbers}[[process]]\nname = \"p\"\nrun = \"playback\"\n[[process]]\nname = \"s\"\nrun = \"std\"\n"
            );
            Std::new(parameters(&Settings::parse("x.toml", &text).unwrap())).unwrap();
        }
    }
}
