//! What the settings of a deployment mean for the mapper.

use ::mapping::{CommitRule, Fades, Parameters, PoseRule, SensorParameters, TuningParameters};
use settings::{BuiltIn, Mapping, Pace, Settings, Tuning};

/// How long past the horizon a verdict or a pose is waited for at sensor pace, s.
///
/// FTI and localisation answer when the scan comes that passes the horizon. That takes milliseconds; one second covers a restart.
const ANSWER_GRACE_S: f64 = 1.0;

/// The mapper's parameters in a deployment whose clock runs `speed` times faster than the wall's.
pub(crate) fn parameters(settings: &Settings, speed: f64) -> Parameters {
    let Mapping { tuning, .. } = &settings.mapping;
    let mapping = &settings.mapping;
    let fades = Fades { occupied_m: mapping.occupied_fade_m.get(), free_m: mapping.free_fade_m.get() };
    Parameters {
        cell_m: mapping.cell_m.get(),
        half_beam_rad: mapping.half_beam_deg.get().to_radians(),
        sensor: SensorParameters {
            k_o: mapping.k_o.get(),
            sigma_r_m: mapping.sigma_r_m.get(),
            no_echo_free_m: mapping.no_echo_free_m.get(),
            fades: mapping.fades.then_some(fades),
        },
        tuning: rules(tuning),
        l_max: mapping.l_max.get(),
        commit: commit(settings, speed),
        poses: poses(settings, speed),
        keep_unfiltered: mapping.keep_unfiltered,
        lonely_below: mapping.lonely_below.get(),
    }
}

/// Live, FTI waits for its inputs; what a restart or a busy machine delays takes so much more sensor time on a faster clock.
fn commit(settings: &Settings, speed: f64) -> CommitRule {
    let horizon_ns = horizon_ns(settings);
    match (settings.expects_verdicts(), settings.pace) {
        (false, _) => CommitRule::Horizon { horizon_ns },
        (true, Pace::Lockstep) => CommitRule::Verdict,
        (true, Pace::Live) => CommitRule::VerdictOrDeadline { deadline_ns: past_horizon(settings, settings.fti.patience_s.get(), speed) },
    }
}

/// Localisation answers a scan for good at the horizon, as FTI does.
fn poses(settings: &Settings, speed: f64) -> PoseRule {
    match (settings.runs(BuiltIn::Localisation), settings.pace) {
        (false, _) => PoseRule::Odometry,
        (true, Pace::Lockstep) => PoseRule::Estimate,
        (true, Pace::Live) => PoseRule::EstimateOrDeadline { deadline_ns: past_horizon(settings, 0.0, speed) },
    }
}

fn horizon_ns(settings: &Settings) -> u64 {
    (settings.mapping.horizon_s.get() * 1e9) as u64
}

/// The age at which an answer that is due at the horizon is not waited for any longer, ns. `patience_s` is how long its process may
/// wait itself.
fn past_horizon(settings: &Settings, patience_s: f64, speed: f64) -> u64 {
    horizon_ns(settings).saturating_add(((ANSWER_GRACE_S + patience_s) * speed.max(1.0) * 1e9) as u64)
}

fn rules(tuning: &Tuning) -> TuningParameters {
    TuningParameters {
        enabled: tuning.enabled,
        p_arc: tuning.p_arc.get(),
        p_free: tuning.p_free.get(),
        gain: tuning.gain.map(|row| row.map(settings::Gain::get)),
        sigma_theta_rad: tuning.sigma_theta_deg.map(|row| row.map(|angle| angle.get().to_radians())),
        k_e: tuning.k_e.map(|row| row.map(settings::FreePeak::get)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use ::mapping::Mapper;

    fn settings(head: &str, table: &str) -> Settings {
        let text = format!(
            "name = \"x\"\n{head}\n[mapping]\n{table}\n[[process]]\nname = \"p\"\nrun = \"playback\"\n[[process]]\nname = \"f\"\nrun = \"fti\"\n[[process]]\nname = \"s\"\nrun = \"std\"\n"
        );
        Settings::parse("x.toml", &text).unwrap()
    }

    #[test]
    fn default_settings_are_the_default_parameters() {
        assert_eq!(parameters(&Settings::default(), 1.0), Parameters::default());
    }

    #[test]
    fn a_verdict_is_due_after_horizon_patience_and_grace() {
        let deadline = |speed| parameters(&settings("pace = \"live\"", ""), speed).commit;
        assert_eq!(deadline(1.0), CommitRule::VerdictOrDeadline { deadline_ns: 4_500_000_000 });
        assert_eq!(deadline(4.0), CommitRule::VerdictOrDeadline { deadline_ns: 9_000_000_000 });
        assert_eq!(parameters(&settings("pace = \"lockstep\"", ""), 4.0).commit, CommitRule::Verdict);
    }

    #[test]
    fn settings_at_their_limits_make_a_mapper() {
        let low = "cell_m = 0.005\nhalf_beam_deg = 1\nk_o = 0.55\nsigma_r_m = 0.005\nl_max = 0.5\nhorizon_s = 0\nno_echo_free_m = 0\noccupied_fade_m = 0.1\nfree_fade_m = 0.1\n";
        let high = "cell_m = 1\nhalf_beam_deg = 60\nk_o = 0.99\nsigma_r_m = 0.5\nl_max = 10\nlonely_below = 8\nhorizon_s = 10\nno_echo_free_m = 20\noccupied_fade_m = 20\nfree_fade_m = 20\n";
        let rules = |name: &str, value: f64| {
            format!("{name} = [[{value}, {value}, {value}], [{value}, {value}, {value}], [{value}, {value}, {value}]]\n")
        };
        let tuning = |[gain, degrees, k_e]: [f64; 3]| {
            format!("[mapping.tuning]\n{}{}{}", rules("gain", gain), rules("sigma_theta_deg", degrees), rules("k_e", k_e))
        };
        for (numbers, limits) in [(low, [0.0, 1.0, 0.01]), (high, [1.0, 90.0, 0.49])] {
            let settings = settings("", &format!("{numbers}{}", tuning(limits)));
            Mapper::new(&parameters(&settings, 1.0)).unwrap();
        }
    }
}
