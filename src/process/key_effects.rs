//! Every key that an algorithm reads changes what the algorithm answers.

use super::simulator::optics as simulator_optics;
use super::{fti, mapping, sbs, std};
use ::evaluate::{CameraSetup, Chain, Drive, Variation, filter, mapped, read_world};
use ::mapping::export::MapCopy;
use ::sbs::{Frame, State};
use ::simulator::CalibrationError;
use ::simulator::camera::{Camera, Flaws, Picture};
use messages::{FrameLayout, PixelFormat};
use serde_json::Value;
use settings::Settings;

/// Sections whose keys this test turns; the others are read by drivers and shells, whose own tests hold them.
const SECTIONS: [&str; 5] = ["mapping", "std", "sbs", "fti", "camera"];
/// Keys of `[camera]` that only the device driver reads.
const OF_THE_DEVICE: [&str; 7] = ["device", "format", "input", "exposure_us", "gain", "white_balance_k", "control"];
/// Keys that decide how long something is waited for, which no replay shows: `process::fti` tests the patience.
const OF_WAITING: [&str; 1] = ["fti.patience_s"];
/// Frames that SBS is given: training, then walkers on the move and at rest for longer than the longest default takeover.
const FRAMES: u64 = 150;
const WORLD: &str = include_str!("../../config/worlds/hall.toml");
const PROCESSES: &str = "name = \"x\"\npace = \"lockstep\"\nprocess = [{ name = \"p\", run = \"playback\" }, { name = \"m\", run = \"mapping\" }, \
    { name = \"s\", run = \"std\" }, { name = \"f\", run = \"fti\" }, { name = \"b\", run = \"sbs\" }]\n";

/// A drive with its camera motion, and its pictures. They stay the same: a key changes what the algorithms make of them.
struct Scene {
    drive: Drive,
    layout: FrameLayout,
    pictures: Vec<(u64, Vec<u8>)>,
}

impl Scene {
    fn new() -> Self {
        let settings = Settings::default();
        let world = read_world(WORLD, Variation { walkers: Some(3), seed: 1, stand_s: None }).unwrap();
        let optics = simulator_optics(&settings.camera);
        let setup = CameraSetup { calibration: CalibrationError::NONE, ..CameraSetup::new(optics) };
        let drive = Drive::through(&world, &super::robot::body(&settings.robot), settings.robot.range_limit_m.get(), Some(&setup), 1);
        let mut camera = Camera::new(&world, &optics, &Flaws::default(), 1);
        let mut picture = Picture::default();
        let mut take = |frame| {
            camera.take(frame, &mut picture);
            (camera.stamp_ns(frame), picture.grey.clone())
        };
        let pictures = (1..=FRAMES).map(&mut take).collect();
        Self { drive, layout: FrameLayout::packed(optics.size_px[0], optics.size_px[1], PixelFormat::Grey), pictures }
    }

    /// What SBS answers to the pictures, or what STD, FTI and mapping answer to the drive.
    fn answers(&self, section: &str, settings: &Settings) -> String {
        if section == "sbs" { self.motion(settings) } else { self.map(settings) }
    }

    fn map(&self, settings: &Settings) -> String {
        let (std, fti, mapping) = (std::parameters(settings), fti::parameters(settings, 1.0), mapping::parameters(settings, 1.0));
        let chain = Chain { std, fti, mapping, localisation: None };
        let outcome = filter(&self.drive, &chain).unwrap();
        let mapper = mapped(&self.drive, &chain.mapping, &outcome.verdicts).unwrap();
        let published = MapCopy::of(&mapper);
        format!("{:?} {:?} {published:?} {}", outcome.motions, outcome.verdicts, mapping_answers(&chain.mapping))
    }

    fn motion(&self, settings: &Settings) -> String {
        let mut state = State::new(sbs::parameters(settings));
        let answer = |(stamp_ns, bytes): &(u64, Vec<u8>)| {
            format!("{:?}", state.step(&Frame { stamp_ns: *stamp_ns, layout: self.layout, bytes, odometry: None }).motion)
        };
        self.pictures.iter().map(answer).collect()
    }
}

/// What of the mapper's parameters no map of a replayed drive shows: when it commits, and which layers it keeps.
fn mapping_answers(parameters: &::mapping::Parameters) -> String {
    format!("{:?} {}", parameters.commit, parameters.keep_unfiltered)
}

/// The leaves of a section of the schema with values to try, as TOML.
fn leaves(root: &Value, table: &Value, path: &str, found: &mut Vec<(String, Vec<String>)>) {
    for (key, property) in table["properties"].as_object().into_iter().flatten() {
        let path = format!("{path}.{key}");
        let kind = resolved(root, property);
        if kind["properties"].is_object() {
            leaves(root, kind, &path, found);
        } else {
            found.push((path, values(root, kind, &property["default"])));
        }
    }
}

fn resolved<'v>(root: &'v Value, schema: &'v Value) -> &'v Value {
    let reference = schema["$ref"].as_str().or_else(|| schema["anyOf"][0]["$ref"].as_str());
    let name = reference.and_then(|reference| reference.rsplit('/').next());
    name.and_then(|name| root["$defs"].get(name)).unwrap_or(schema)
}

fn values(root: &Value, kind: &Value, default: &Value) -> Vec<String> {
    if let Some(choices) = kind["oneOf"].as_array().or_else(|| kind["enum"].as_array()) {
        return choices.iter().map(|choice| choice.get("const").unwrap_or(choice).to_string()).collect();
    }
    if let (Some(rows), Some(cell)) =
        (default.as_array(), kind["items"]["items"].is_object().then(|| resolved(root, &kind["items"]["items"])))
    {
        // Tables change in every cell: which of them fire is the drive's.
        return values(root, cell, &default[0][0])
            .into_iter()
            .map(|value| {
                format!(
                    "[{}]",
                    vec![format!("[{}]", vec![value; rows[0].as_array().map_or(0, Vec::len)].join(", ")); rows.len()].join(", ")
                )
            })
            .collect();
    }
    if kind["type"] == "array" || kind["x-form"].as_str().is_some_and(|form| form.starts_with("three")) {
        return vec!["[0.2, 0.4, 0.6]".to_owned(), "[0.6, 0.8, 0.95]".to_owned()];
    }
    if kind["type"] == "boolean" {
        return vec!["true".to_owned(), "false".to_owned()];
    }
    let (Some(low), Some(high)) = (kind["minimum"].as_f64(), kind["maximum"].as_f64()) else { return Vec::new() };
    let middle = default.as_f64().unwrap_or(low);
    let numbers = [low, 0.5 * (low + middle), 0.9 * middle, 1.2 * middle + 0.1 * low.abs(), 0.5 * (middle + high), high];
    let is_integer = kind["type"] == "integer";
    let within = numbers.into_iter().filter(|number| (low..=high).contains(number));
    within.map(|number| if is_integer { format!("{}", number.round()) } else { format!("{number:?}") }).collect()
}

/// The deployment in which a key is read.
fn base(key: &str) -> &'static str {
    match key {
        _ if key.starts_with("fti.paper") => "fti.method = \"paper\"\n",
        _ => "",
    }
}

#[test]
fn every_algorithm_key_changes_an_answer() {
    let root: Value = serde_json::from_str(&settings::schema()).unwrap();
    let scene = Scene::new();
    let parse = |text: &str| Settings::parse("x.toml", &format!("{PROCESSES}{text}")).unwrap_or_else(|error| panic!("{error}: {text}"));
    let mut dead = Vec::new();
    for section in SECTIONS {
        let mut keys = Vec::new();
        leaves(&root, resolved(&root, &root["properties"][section]), section, &mut keys);
        for (key, values) in keys {
            let name = key.strip_prefix("camera.").unwrap_or_default();
            if OF_THE_DEVICE.contains(&name) || OF_WAITING.contains(&key.as_str()) || is_of_the_picture(name) {
                continue;
            }
            let without = scene.answers(section, &parse(base(&key)));
            let changes = |value: &String| scene.answers(section, &parse(&format!("{}{key} = {value}\n", base(&key)))) != without;
            if !values.iter().any(changes) {
                dead.push(key);
            }
        }
    }
    assert!(dead.is_empty(), "no value of these keys changes an answer: {dead:?}");
}

/// Keys of `[camera]` that are the size and rate of its pictures: the driver asks the device for them, the simulator renders them.
fn is_of_the_picture(name: &str) -> bool {
    ["width", "height", "rate_hz"].contains(&name)
}
