//! Bags of ROS 2: the settings of a log that is imported, from what the bag says and what the user gives, and the sensors of a log that
//! is exported, from its settings.

use crate::exit::BadInput;
use crate::output;
use crate::process::robot::sonars;
use crate::replay::{is_replayed, recorded_settings};
use drivelog::{Log, Preamble};
use messages::Pose;
use ros2::{Bag, CameraFound, Sensors, SonarFound, Survey};
use settings::{BuiltIn, OutOfRange, Process, Program, Settings, Sonar};
use std::path::Path;

/// Mounts that differ by less than this, in m and rad, are the same: a transform holds a heading as a quaternion.
const SAME_MOUNT: f64 = 1e-6;

/// Imports a bag and prints what came of it.
pub(super) fn import(from: &Path, topics: &[String], settings: Option<&Path>, out: &Path) -> anyhow::Result<()> {
    let bag = Bag::open(from)?;
    let survey = ros2::survey(&bag, topics)?;
    let given = match (settings, &survey.settings) {
        (Some(file), _) => Some(Settings::read(file)?),
        (None, Some(text)) => Some(recorded_settings(from, text)?),
        (None, None) => None,
    };
    let sonars = mounts(&survey.sonars, given.as_ref())?;
    let (settings, assumed) = deployment(&survey, given, &sonars)?;
    settings.check().map_err(|fault| BadInput(format!("{}: {fault}", from.display())))?;
    let preamble = Preamble {
        // Two imports of a bag are the same log.
        run: 1,
        robot: settings.robot.model.get().name.to_owned(),
        sonars,
        origin: format!("imported from a bag of ROS 2, {}", from.display()),
        settings: settings.to_toml()?,
    };
    let topics: Vec<String> = survey.sonars.iter().map(|sonar| sonar.topic.clone()).collect();
    let imported = ros2::import(&bag, survey, &preamble, out)?;
    for (number, (topic, mount)) in topics.iter().zip(&preamble.sonars).enumerate() {
        let heading_deg = mount.yaw_rad.to_degrees();
        output::line(&format!("sonar {number:<3} {topic} at x {:.3} m, y {:.3} m, {heading_deg:.1}°", mount.x_m, mount.y_m))?;
    }
    for line in assumed {
        output::line(&format!("assumed   {line}"))?;
    }
    for line in &imported.left_out {
        output::line(&format!("left out  {line}"))?;
    }
    let (scans, readings, pictures) = (imported.scans, imported.readings, imported.pictures);
    Ok(output::line(&format!("{}: {scans} scans with {readings} readings, {pictures} pictures", out.display()))?)
}

/// Exports a log and prints what came of it.
pub(super) fn export(path: &Path, out: &Path) -> anyhow::Result<()> {
    let mut log = Log::open(path)?;
    let Settings { robot, camera, mapping, .. } = recorded_settings(path, &log.preamble().settings)?;
    let sensors = Sensors {
        sonars: log.preamble().sonars.clone(),
        max_range_m: robot.range_limit_m.get(),
        field_of_view_rad: 2.0 * mapping.half_beam_deg.get().to_radians(),
        camera: Pose { x_m: camera.x_m.get(), y_m: camera.y_m.get(), yaw_rad: camera.heading_deg.get().to_radians() },
        camera_height_m: camera.height_m.get(),
        camera_field_of_view_rad: camera.field_of_view_deg.get().to_radians(),
        horizon_share: camera.horizon_share.get(),
    };
    let exported = ros2::export(&mut log, &sensors, out)?;
    for (topic, messages) in &exported.messages {
        output::line(&format!("topic     {topic:<26} {messages:>8} messages"))?;
    }
    for line in exported.left_out.iter().cloned().chain(log.gaps().lines()) {
        output::line(&format!("left out  {line}"))?;
    }
    let messages: u64 = exported.messages.values().sum();
    Ok(output::line(&format!("{}: {messages} messages", out.display()))?)
}

/// The mount of each sonar: that of the bag, or else that of the settings if these have as many sonars.
fn mounts(found: &[SonarFound], given: Option<&Settings>) -> anyhow::Result<Vec<Pose>> {
    let ring = given.map(|settings| sonars(&settings.robot)).unwrap_or_default();
    let of_settings = |number: usize| ring.get(number).filter(|_| ring.len() == found.len());
    let mount = |(number, sonar): (usize, &SonarFound)| match (sonar.mount, of_settings(number)) {
        (Some(mount), Some(set)) if is_same(&mount, set) => Ok(*set),
        (Some(mount), _) => Ok(mount),
        (None, Some(set)) => Ok(*set),
        (None, None) => Err(BadInput(format!(
            "topic {}: no transform of /tf_static leads from its frame {:?} to the robot; give its mount by --settings with one \
             [[robot.sonar]] for each of the {} sonars",
            sonar.topic,
            sonar.frame,
            found.len()
        ))
        .into()),
    };
    found.iter().enumerate().map(mount).collect()
}

fn is_same(one: &Pose, other: &Pose) -> bool {
    let turn = (one.yaw_rad - other.yaw_rad).sin();
    [one.x_m - other.x_m, one.y_m - other.y_m, turn].iter().all(|difference| difference.abs() < SAME_MOUNT)
}

/// The deployment that replays the log, and what is assumed in it.
fn deployment(survey: &Survey, given: Option<Settings>, mounts: &[Pose]) -> anyhow::Result<(Settings, Vec<String>)> {
    let mut assumed = Vec::new();
    let mut settings = match given {
        Some(settings) => settings,
        None => of_bag(survey, &mut assumed)?,
    };
    let has_camera = survey.camera.is_some();
    settings.process.retain(|process| match process.program {
        Program::BuiltIn(BuiltIn::Sbs) => has_camera,
        Program::BuiltIn(kind) => is_replayed(kind),
        Program::Command(_) => false,
    });
    settings.process.push(Process::built_in(BuiltIn::Playback));
    settings.fault.clear();
    settings.supervisor.on_event.clear();
    settings.recorder.pictures = has_camera;
    settings.playback.camera_motion = false;
    if mounts != sonars(&settings.robot) {
        settings.robot.sonar = survey.sonars.iter().zip(mounts).map(|(found, mount)| sonar(found, mount)).collect::<Result<_, _>>()?;
    }
    if let Some(camera) = &survey.camera {
        settings.camera.width = in_range(&camera.topic, "width", camera.layout.width)?;
        settings.camera.height = in_range(&camera.topic, "height", camera.layout.height)?;
    }
    Ok((settings, assumed))
}

fn sonar(found: &SonarFound, mount: &Pose) -> anyhow::Result<Sonar> {
    Ok(Sonar {
        x_m: in_range(&found.topic, "mount in x", mount.x_m)?,
        y_m: in_range(&found.topic, "mount in y", mount.y_m)?,
        heading_deg: in_range(&found.topic, "heading", mount.yaw_rad.to_degrees())?,
    })
}

/// A number of a topic as a value of the settings.
fn in_range<T: TryFrom<N, Error = OutOfRange>, N>(topic: &str, what: &str, number: N) -> Result<T, BadInput> {
    number.try_into().map_err(|error: OutOfRange| BadInput(format!("topic {topic}: {what}: {error}")))
}

/// Settings from what the bag says of its sensors.
fn of_bag(survey: &Survey, assumed: &mut Vec<String>) -> anyhow::Result<Settings> {
    let mut settings =
        Settings { process: [BuiltIn::Mapping, BuiltIn::Std, BuiltIn::Fti].map(Process::built_in).into(), ..Settings::default() };
    // A range of 0.2 m is the least that settings allow.
    let furthest_m = survey.sonars.iter().map(|sonar| sonar.max_range_m).fold(0.2, f64::max);
    let topic = survey.sonars.first().map_or("", |sonar| &sonar.topic);
    settings.robot.range_limit_m = in_range(topic, "max_range", furthest_m)?;
    let widest_rad = survey.sonars.iter().map(|sonar| sonar.field_of_view_rad).fold(0.0, f64::max);
    match (widest_rad / 2.0).to_degrees().try_into() {
        Ok(half_beam_deg) => settings.mapping.half_beam_deg = half_beam_deg,
        Err(OutOfRange { .. }) => assumed.push(format!(
            "the opening angle of the sonars is {:.1}°: their field_of_view is {widest_rad} rad",
            2.0 * settings.mapping.half_beam_deg.get()
        )),
    }
    if let Some(camera) = &survey.camera {
        settings.process.push(Process::built_in(BuiltIn::Sbs));
        place_camera(&mut settings.camera, camera, assumed)?;
    }
    Ok(settings)
}

/// The mount and the optics of the camera, as far as the bag has them.
fn place_camera(settings: &mut settings::Camera, found: &CameraFound, assumed: &mut Vec<String>) -> anyhow::Result<()> {
    let topic = &found.topic;
    match &found.mount {
        Some(mount) => {
            settings.x_m = in_range(topic, "mount in x", mount.x_m)?;
            settings.y_m = in_range(topic, "mount in y", mount.y_m)?;
            settings.height_m = in_range(topic, "height above the robot's frame", mount.height_m)?;
            settings.heading_deg = in_range(topic, "heading", mount.heading_rad.to_degrees())?;
        }
        None => assumed.push(format!(
            "topic {topic}: its camera looks ahead from {} m above the floor: no transform of /tf_static leads to its frame",
            settings.height_m.get()
        )),
    }
    match &found.optics {
        Some(optics) => {
            let horizon_share = optics.horizon_share(found.mount.map_or(0.0, |mount| mount.tilt_rad));
            settings.field_of_view_deg = in_range(topic, "field of view", optics.field_of_view_rad.to_degrees())?;
            settings.horizon_share = in_range(topic, "row of the horizon", horizon_share)?;
        }
        None => assumed.push(format!(
            "topic {topic}: its camera has a field of view of {}° and is level: no CameraInfo with a calibration stands beside it",
            settings.field_of_view_deg.get()
        )),
    }
    Ok(())
}
