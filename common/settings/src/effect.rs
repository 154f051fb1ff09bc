//! Which keys have an effect in a deployment: a key that nothing reads is refused, not ignored.

use document::Fault;
use toml::{Table, Value};

use crate::{BuiltIn, FtiMethod, MovingCell, Pace, Port, Provides, Settings};

/// A key or section, when it is read, and what the file should say otherwise.
struct Rule {
    key: &'static str,
    is_read: fn(&Settings) -> bool,
    expected: &'static str,
}

const fn rule(key: &'static str, is_read: fn(&Settings) -> bool, expected: &'static str) -> Rule {
    Rule { key, is_read, expected }
}

fn sees(settings: &Settings) -> bool {
    settings.runs(BuiltIn::Camera) || simulates_pictures(settings) || settings.expects_camera_motion()
}

fn simulates_pictures(settings: &Settings) -> bool {
    settings.runs(BuiltIn::Simulator) && settings.simulator.camera.provides == Provides::Pictures
}

fn maps(settings: &Settings) -> bool {
    [BuiltIn::Mapping, BuiltIn::Std, BuiltIn::Fti].into_iter().any(|kind| settings.runs(kind))
}

fn likelihood(settings: &Settings) -> bool {
    settings.fti.method == FtiMethod::Likelihood
}

const RULES: &[Rule] = &[
    rule("camera", sees, "no [camera], or else a process that takes pictures or uses the motion in them"),
    rule("camera.device", |s| s.runs(BuiltIn::Camera), NO_CAMERA),
    rule("camera.format", |s| s.runs(BuiltIn::Camera), NO_CAMERA),
    rule("camera.input", |s| s.runs(BuiltIn::Camera), NO_CAMERA),
    rule("camera.exposure_us", |s| s.runs(BuiltIn::Camera), NO_CAMERA),
    rule("camera.gain", |s| s.runs(BuiltIn::Camera), NO_CAMERA),
    rule("camera.white_balance_k", |s| s.runs(BuiltIn::Camera), NO_CAMERA),
    rule("camera.control", |s| s.runs(BuiltIn::Camera), NO_CAMERA),
    rule("pioneer", |s| s.runs(BuiltIn::Pioneer), "no [pioneer], or else a process with run = \"pioneer\""),
    rule(
        "pioneer.bauds",
        |s| !matches!(s.pioneer.port, Port::Network(_)),
        "no such key, or else a serial device as pioneer.port: a network port has no speed",
    ),
    rule("simulator", |s| s.runs(BuiltIn::Simulator), "no [simulator], or else a process with run = \"simulator\""),
    rule("mapping", maps, "no [mapping], or else a process with run = \"mapping\""),
    rule("mapping.occupied_fade_m", |s| s.mapping.fades, NO_FADE),
    rule("mapping.free_fade_m", |s| s.mapping.fades, NO_FADE),
    rule("mapping.tuning.p_arc", |s| s.mapping.tuning.enabled, NO_TUNING),
    rule("mapping.tuning.p_free", |s| s.mapping.tuning.enabled, NO_TUNING),
    rule("std", |s| s.runs(BuiltIn::Std), "no [std], or else a process with run = \"std\""),
    rule("std.free_for_scans", |s| s.std.rule == MovingCell::Visible, "no such key, or else std.rule = \"visible\""),
    rule("sbs", |s| s.runs(BuiltIn::Sbs), "no [sbs], or else a process with run = \"sbs\""),
    rule("fti", |s| s.runs(BuiltIn::Fti), "no [fti], or else a process with run = \"fti\""),
    rule("fti.prior_log_odds", likelihood, "no such key, or else fti.method = \"likelihood\""),
    rule("fti.patience_s", |s| s.pace == Pace::Live, "no such key, or else pace = \"live\""),
    rule("fti.paper", |s| !likelihood(s), "no [fti.paper], or else fti.method = \"paper\""),
    rule("localisation", |s| s.runs(BuiltIn::Localisation), "no [localisation], or else a process with run = \"localisation\""),
    rule("recorder", |s| s.runs(BuiltIn::Recorder), "no [recorder], or else a process with run = \"recorder\""),
    rule("playback", |s| s.runs(BuiltIn::Playback), "no [playback], or else a process with run = \"playback\""),
    rule("viewer", |s| s.runs(BuiltIn::Viewer), "no [viewer], or else a process with run = \"viewer\""),
];

const NO_CAMERA: &str = "no such key, or else a process with run = \"camera\"";
const NO_FADE: &str = "no such key, or else mapping.fades = true";
const NO_TUNING: &str = "no such key, or else mapping.tuning.enabled = true";

/// Refuses the first key of `text` that nothing in the deployment reads.
pub(crate) fn check(settings: &Settings, text: &str) -> Result<(), Fault> {
    // The text has been parsed already: it is a table.
    let Ok(table) = text.parse::<Table>() else { return Ok(()) };
    match RULES.iter().find(|rule| !(rule.is_read)(settings) && at(&table, rule.key).is_some()) {
        Some(rule) => Err(Fault::new(rule.key, rule.expected)),
        None => Ok(()),
    }
}

fn at<'t>(table: &'t Table, key: &str) -> Option<&'t Value> {
    let (head, rest) = key.split_once('.').unwrap_or((key, ""));
    match (table.get(head)?, rest) {
        (value, "") => Some(value),
        (value, rest) => at(value.as_table()?, rest),
    }
}

/// The text without the value at a path such as `process[0].name`; `None` where there is none.
pub(crate) fn without(text: &str, key: &str) -> Option<String> {
    let mut document = Value::Table(text.parse::<Table>().ok()?);
    let (parent, name) = key.rsplit_once('.').unwrap_or(("", key));
    let mut value = &mut document;
    for segment in parent.split(['.', '[']).filter(|segment| !segment.is_empty()) {
        value = match segment.strip_suffix(']') {
            Some(index) => value.as_array_mut()?.get_mut(index.parse::<usize>().ok()?)?,
            None => value.as_table_mut()?.get_mut(segment)?,
        };
    }
    value.as_table_mut()?.remove(name)?;
    toml::to_string(&document).ok()
}

/// Removes the keys whose values are those of `defaults`, and the tables that this empties.
pub(crate) fn remove_equal(set: &mut Table, defaults: &Table) {
    set.retain(|key, value| {
        let default = defaults.get(key);
        match (value, default) {
            (Value::Table(table), Some(Value::Table(default))) => {
                remove_equal(table, default);
                !table.is_empty()
            }
            (value, default) => default != Some(value),
        }
    });
}
