//! The controls of a camera: what has to be set for what a person asks for.
//!
//! Background subtraction wants a camera that does not change its mind: exposure, gain and white balance are held when the
//! settings say where. The automatic that would move one of them is switched off first.

/// What a person asks of a camera's controls.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct FixedControls {
    /// Exposure time, µs; the device's automatic when not given.
    pub exposure_us: Option<u32>,
    /// Gain, in the device's own units; the device's automatic when not given.
    pub gain: Option<u32>,
    /// White balance as a colour temperature, K; the device's automatic when not given.
    pub white_balance_k: Option<u32>,
    /// Any other control by its name, as [`ControlInfo::key`] has it, and its value.
    pub others: Vec<(String, i32)>,
}

/// A control that a camera has.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ControlInfo {
    /// Its number, by which the kernel knows it.
    pub id: u32,
    /// Its name for people.
    pub name: String,
    /// The least and the greatest value.
    pub range: (i32, i32),
    /// Its default value.
    pub default: i32,
}

/// A control that is to be set.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ControlSetting {
    /// Its number.
    pub id: u32,
    /// Its name in the settings.
    pub name: String,
    /// The value.
    pub value: i32,
}

/// Why a control is not as it was asked for. The camera works without.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum ControlTrouble {
    /// The camera does not have it.
    #[error("this camera has no control {0}: `stillmap camera list` shows what it has")]
    None(String),
    /// The camera's range ends before.
    #[error("{name} = {wanted}: this camera takes {} to {}", range.0, range.1)]
    Range {
        /// The control's name in the settings.
        name: String,
        /// The value asked for.
        wanted: i64,
        /// The least and the greatest value.
        range: (i64, i64),
    },
    /// The camera refuses or takes another value.
    #[error("{name} = {wanted}: the camera {answer}")]
    Refused {
        /// The control's name in the settings.
        name: String,
        /// The value asked for.
        wanted: i32,
        /// What it does instead.
        answer: String,
    },
}

/// Numbers of `linux/v4l2-controls.h`.
mod id {
    pub(super) const AUTO_WHITE_BALANCE: u32 = 0x0098_090c;
    pub(super) const AUTO_GAIN: u32 = 0x0098_0912;
    pub(super) const GAIN: u32 = 0x0098_0913;
    pub(super) const WHITE_BALANCE_K: u32 = 0x0098_091a;
    pub(super) const EXPOSURE_AUTO: u32 = 0x009a_0901;
    pub(super) const EXPOSURE_100_US: u32 = 0x009a_0902;
}

/// `V4L2_EXPOSURE_MANUAL`.
const EXPOSURE_MANUAL: i32 = 1;

/// A control of [`FixedControls`]: what it is called there, its unit in the device's units, its number, and the automatic to switch off.
struct Known {
    name: &'static str,
    unit: u32,
    id: u32,
    automatic: (u32, i32),
}

const EXPOSURE: Known = Known { name: "exposure_us", unit: 100, id: id::EXPOSURE_100_US, automatic: (id::EXPOSURE_AUTO, EXPOSURE_MANUAL) };
const GAIN: Known = Known { name: "gain", unit: 1, id: id::GAIN, automatic: (id::AUTO_GAIN, 0) };
const WHITE_BALANCE: Known = Known { name: "white_balance_k", unit: 1, id: id::WHITE_BALANCE_K, automatic: (id::AUTO_WHITE_BALANCE, 0) };

impl ControlInfo {
    /// Its name as settings write it: letters and digits in lower case, everything else an underscore.
    #[must_use]
    pub fn key(&self) -> String {
        let words = self.name.split(|letter: char| !letter.is_ascii_alphanumeric()).filter(|word| !word.is_empty());
        words.map(str::to_ascii_lowercase).collect::<Vec<_>>().join("_")
    }
}

impl FixedControls {
    /// What to set on a camera that has these controls, in this order, and what cannot be.
    #[must_use]
    pub fn settings(&self, offered: &[ControlInfo]) -> (Vec<ControlSetting>, Vec<ControlTrouble>) {
        let known = [
            (EXPOSURE, self.exposure_us.map(i64::from)),
            (GAIN, self.gain.map(i64::from)),
            (WHITE_BALANCE, self.white_balance_k.map(i64::from)),
        ];
        let (mut settings, mut troubles) = (Vec::new(), Vec::new());
        for (known, wanted) in known {
            let Some(wanted) = wanted else { continue };
            let found = offered.iter().find(|control| control.id == known.id);
            match setting(found, known.name, wanted, known.unit) {
                Ok(setting) => {
                    let automatic = offered.iter().find(|control| control.id == known.automatic.0);
                    settings.extend(automatic.map(|control| ControlSetting {
                        id: control.id,
                        name: control.key(),
                        value: known.automatic.1,
                    }));
                    settings.push(setting);
                }
                Err(trouble) => troubles.push(trouble),
            }
        }
        for (name, value) in &self.others {
            match setting(offered.iter().find(|control| control.key() == *name), name, i64::from(*value), 1) {
                Ok(setting) => settings.push(setting),
                Err(trouble) => troubles.push(trouble),
            }
        }
        (settings, troubles)
    }
}

/// The setting of a control to a value in units of the settings, `unit` of which are one of the device's.
fn setting(found: Option<&ControlInfo>, name: &str, wanted: i64, unit: u32) -> Result<ControlSetting, ControlTrouble> {
    let control = found.ok_or_else(|| ControlTrouble::None(name.to_owned()))?;
    let unit = i64::from(unit);
    let range = (i64::from(control.range.0) * unit, i64::from(control.range.1) * unit);
    let in_range = i32::try_from(wanted / unit).ok().filter(|_| (range.0..=range.1).contains(&wanted));
    let value = in_range.ok_or(ControlTrouble::Range { name: name.to_owned(), wanted, range })?;
    Ok(ControlSetting { id: control.id, name: name.to_owned(), value })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn control(id: u32, name: &str, range: (i32, i32)) -> ControlInfo {
        ControlInfo { id, name: name.to_owned(), range, default: 0 }
    }

    fn webcam() -> Vec<ControlInfo> {
        vec![
            control(0x0098_0900, "Brightness", (-64, 64)),
            control(id::AUTO_WHITE_BALANCE, "White Balance, Automatic", (0, 1)),
            control(id::GAIN, "Gain", (0, 100)),
            control(0x0098_0918, "Power Line Frequency", (0, 2)),
            control(id::WHITE_BALANCE_K, "White Balance Temperature", (2800, 6500)),
            control(id::EXPOSURE_AUTO, "Auto Exposure", (0, 3)),
            control(id::EXPOSURE_100_US, "Exposure Time, Absolute", (1, 5000)),
        ]
    }

    #[track_caller]
    fn check(controls: &FixedControls, set: &[(u32, i32)], troubles: &[&str]) {
        let (settings, found) = controls.settings(&webcam());
        assert_eq!(settings.iter().map(|setting| (setting.id, setting.value)).collect::<Vec<_>>(), set);
        assert_eq!(found.iter().map(ToString::to_string).collect::<Vec<_>>(), troubles);
    }

    #[test]
    fn nothing_asked_nothing_set() {
        check(&FixedControls::default(), &[], &[]);
    }

    #[test]
    fn an_automatic_is_switched_off_before_its_value_is_set() {
        check(
            &FixedControls { exposure_us: Some(10_000), gain: Some(40), white_balance_k: Some(4600), others: Vec::new() },
            &[
                (id::EXPOSURE_AUTO, EXPOSURE_MANUAL),
                (id::EXPOSURE_100_US, 100),
                // It has no automatic gain.
                (id::GAIN, 40),
                (id::AUTO_WHITE_BALANCE, 0),
                (id::WHITE_BALANCE_K, 4600),
            ],
            &[],
        );
    }

    #[test]
    fn controls_that_the_camera_lacks_leave_the_others_set() {
        check(
            &FixedControls {
                exposure_us: Some(900_000),
                gain: Some(101),
                white_balance_k: None,
                others: vec![("power_line_frequency".to_owned(), 1), ("focus".to_owned(), 3), ("brightness".to_owned(), 99)],
            },
            &[(0x0098_0918, 1)],
            &[
                "exposure_us = 900000: this camera takes 100 to 500000",
                "gain = 101: this camera takes 0 to 100",
                "this camera has no control focus: `stillmap camera list` shows what it has",
                "brightness = 99: this camera takes -64 to 64",
            ],
        );
    }

    #[test]
    fn names_are_written_as_settings_write_them() {
        assert_eq!(webcam()[1].key(), "white_balance_automatic");
        assert_eq!(webcam()[6].key(), "exposure_time_absolute");
    }
}
