//! What the settings of a deployment mean for SBS.

use ::sbs::background::BackgroundRule;
use ::sbs::transform::Class;
use ::sbs::{BlobRule, Method, Parameters};
use settings::{Freedom, SbsMethod, Settings};

/// SBS's parameters in a deployment with these settings.
pub(crate) fn parameters(settings: &Settings) -> Parameters {
    let (sbs, camera) = (&settings.sbs, &settings.camera);
    // Their ranges are those of a byte.
    let frames = |setting: settings::Takeover| u8::try_from(setting.get()).unwrap_or(u8::MAX);
    Parameters {
        method: match sbs.method {
            SbsMethod::Direct => Method::Direct,
            SbsMethod::Paper => Method::Icp,
        },
        class: match sbs.freedom {
            Freedom::Similarity => Class::Similarity,
            Freedom::Affine => Class::Affine,
            Freedom::Homography => Class::Homography,
        },
        horizon: camera.horizon_share.get().clamp(0.0, 1.0) as f32,
        field_of_view_rad: camera.field_of_view_deg.get().to_radians(),
        training_frames: sbs.training_frames.get() as usize,
        background: BackgroundRule {
            k: sbs.k.get() as f32,
            takeover: frames(sbs.takeover_frames),
            takeover_still: frames(sbs.takeover_still_frames),
            ..BackgroundRule::default()
        },
        blobs: BlobRule { size_min: sbs.min_area_px.get() as f32, ..BlobRule::default() },
        beta: sbs.beta.get(),
        h_bar: sbs.h_bar.get(),
        ..Parameters::default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn default_settings_are_the_default_parameters() {
        assert_eq!(parameters(&Settings::default()), Parameters::default());
    }

    #[test]
    fn what_is_set_is_what_it_works_by() {
        let text = "name = \"x\"\n[camera]\nhorizon_share = 0.4\nfield_of_view_deg = 90\n[sbs]\nmethod = \"paper\"\nk = 2.5\nbeta = 1.0\nmin_area_px = 10\ntakeover_frames = 255\n[[process]]\nname = \"p\"\nrun = \"playback\"\n[[process]]\nname = \"s\"\nrun = \"sbs\"\n";
        let expected = Parameters {
            method: Method::Icp,
            horizon: 0.4,
            field_of_view_rad: std::f64::consts::FRAC_PI_2,
            background: BackgroundRule { k: 2.5, takeover: 255, ..BackgroundRule::default() },
            blobs: BlobRule { size_min: 10.0, ..BlobRule::default() },
            beta: 1.0,
            ..Parameters::default()
        };
        assert_eq!(parameters(&Settings::parse("x.toml", text).unwrap()), expected);
    }
}
