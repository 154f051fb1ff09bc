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
pub(super) fn import(from: &Path, topics: &[String], settings_file: Option<&Path>, out: &Path) -> anyhow::Result<()> {
    let bag = Bag::open(from)?;
    let survey = ros2::survey(&bag, topics)?;
    let given = match (settings_file, &survey.settings) {
        (Some(file), _) => Some(Settings::read(file)?),
        (None, Some(text)) => Some(recorded_settings(from, text)?),
        (None, None) => None,
    };
    // The file of the user is not mended with what the bag says.
    let unused: Vec<String> = settings_file.into_iter().flat_map(|file| unused(&survey, file)).collect();
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
    for line in unused {
        output::line(&format!("unused    {line}"))?;
    }
    for line in &imported.left_out {
        output::line(&format!("left out  {line}"))?;
    }
    let (scans, readings, pictures) = (imported.scans, imported.readings, imported.pictures);
    Ok(output::line(&format!("{}: {scans} scans with {readings} readings, {pictures} pictures", out.display()))?)
}

/// What a bag says of its camera and a file of settings overrides.
fn unused(survey: &Survey, file: &Path) -> Vec<String> {
    let Some(CameraFound { topic, mount, optics, .. }) = &survey.camera else { return Vec::new() };
    let line = |what: &str, of: &str| format!("topic {topic}: {what} of its camera in {of}; that of {} is taken", file.display());
    let mount = mount.map(|_| line("the mount", "/tf_static"));
    let optics = optics.map(|_| line("the field of view", "CameraInfo"));
    mount.into_iter().chain(optics).collect()
}

/// Exports a log and prints what came of it.
pub(super) fn export(path: &Path, out: &Path) -> anyhow::Result<()> {
    let mut log = Log::open(path)?;
    let settings = recorded_settings(path, &log.preamble().settings)?;
    let is_localised = settings.runs(BuiltIn::Localisation);
    let Settings { robot, camera, mapping, .. } = settings;
    let sensors = Sensors {
        sonars: log.preamble().sonars.clone(),
        max_range_m: robot.range_limit_m.get(),
        field_of_view_rad: 2.0 * mapping.half_beam_deg.get().to_radians(),
        camera: Pose { x_m: camera.x_m.get(), y_m: camera.y_m.get(), yaw_rad: camera.heading_deg.get().to_radians() },
        camera_height_m: camera.height_m.get(),
        camera_field_of_view_rad: camera.field_of_view_deg.get().to_radians(),
        horizon_share: camera.horizon_share.get(),
        is_localised,
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::built_in::DEMO;
    use drivelog::Recording;
    use messages::{CameraFrame, FrameLayout, PixelFormat, SonarReading, SonarScan};
    use std::fs;

    /// A log of a deployment with three scans and pictures.
    fn record(settings: &Settings, path: &Path) {
        let (robot, sonars) = (settings.robot.model.get().name.to_owned(), sonars(&settings.robot));
        let preamble = Preamble { run: 1, robot, sonars, origin: "a test".to_owned(), settings: settings.to_toml().unwrap() };
        let mut recording = Recording::new(&preamble).unwrap();
        let layout = FrameLayout::packed(80, 60, PixelFormat::Grey);
        for seq in 1..=3 {
            let stamp_ns = seq * 100_000_000;
            let reading = SonarReading::new(0, preamble.sonars[0], 1.0, true);
            recording.scan(seq, stamp_ns, &SonarScan::new(Pose::default(), &[reading], false)).unwrap();
            recording.picture::<CameraFrame>(seq, stamp_ns, &layout, &vec![7; layout.bytes()]).unwrap();
        }
        fs::write(path, recording.finish().unwrap()).unwrap();
    }

    #[test]
    fn a_bag_of_a_log_keeps_localisation_and_no_program() {
        let folder = tempfile::tempdir().unwrap();
        let [log, bag, again] = ["log.mcap", "bag", "again.mcap"].map(|name| folder.path().join(name));
        let mut recorded = Settings::parse("demo.toml", DEMO).unwrap();
        recorded.process.push(Process::built_in(BuiltIn::Localisation));
        recorded.supervisor.on_event = vec!["sh".into(), "-c".into(), "a program of strangers".into()];
        record(&recorded, &log);
        export(&log, &bag).unwrap();
        import(&bag, &[], None, &again).unwrap();
        let imported = recorded_settings(&again, &Log::open(&again).unwrap().preamble().settings).unwrap();
        let runs = [BuiltIn::Localisation, BuiltIn::Sbs, BuiltIn::Playback, BuiltIn::Simulator].map(|kind| imported.runs(kind));
        assert_eq!(runs, [true, true, true, false]);
        assert!(imported.supervisor.on_event.is_empty());
    }

    #[test]
    fn a_camera_of_a_settings_file_replaces_that_of_the_bag() {
        let folder = tempfile::tempdir().unwrap();
        let [log, bag] = ["log.mcap", "bag"].map(|name| folder.path().join(name));
        record(&Settings::parse("demo.toml", DEMO).unwrap(), &log);
        export(&log, &bag).unwrap();
        let mut survey = ros2::survey(&Bag::open(&bag).unwrap(), &[]).unwrap();
        let lines = unused(&survey, Path::new("own.toml"));
        assert_eq!(
            lines,
            [
                "topic /camera/image_raw: the mount of its camera in /tf_static; that of own.toml is taken",
                "topic /camera/image_raw: the field of view of its camera in CameraInfo; that of own.toml is taken",
            ]
        );
        survey.camera = None;
        assert!(unused(&survey, Path::new("own.toml")).is_empty());
    }
}
