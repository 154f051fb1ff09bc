//! `stillmap check`: settings and worlds before they are used, and whether the programs and devices that they name exist.

use crate::exit::BadInput;
use crate::output;
use crate::process::playback;
use clap::Args;
use messages::{CameraFrame, SonarScan};
use pioneer::{Address, Opening};
use rustix::fs::OFlags;
use serde::Deserialize;
use serde::de::IgnoredAny;
use settings::{BuiltIn, NetworkPort, Port, Program, Settings};
use std::fs::OpenOptions;
use std::io;
use std::os::unix::fs::{FileTypeExt, OpenOptionsExt};
use std::path::{Path, PathBuf};
use supervisor::find_program;

/// Opens a device without waiting for a carrier, and without making it the terminal of this command (open(2)).
const WITHOUT_WAITING: OFlags = OFlags::NONBLOCK.union(OFlags::NOCTTY);

/// Arguments of `stillmap check`.
#[derive(Debug, Args)]
#[command(group = clap::ArgGroup::new("what").required(true))]
pub(crate) struct CheckArgs {
    /// The file: settings, or a world of the simulator
    #[arg(value_name = "FILE", group = "what")]
    file: Option<PathBuf>,
    /// Print the JSON schema of settings files
    #[arg(long, group = "what")]
    schema: bool,
    /// Print the reference of all settings
    #[arg(long, group = "what")]
    reference: bool,
    /// Print the wire contract: every service and payload, and the rules for drivers
    #[arg(long, group = "what")]
    wire: bool,
    /// Print the wire contract as a Python module: every payload as a structure of ctypes
    #[arg(long, group = "what")]
    python: bool,
}

/// Checks a file, or prints the schema or the reference of all settings, or the wire contract.
pub(crate) fn check(args: &CheckArgs) -> anyhow::Result<()> {
    match args {
        CheckArgs { file: Some(file), .. } => check_file(file)?,
        CheckArgs { schema: true, .. } => output::write(&settings::schema())?,
        CheckArgs { wire: true, .. } => output::write(&messages::reference())?,
        CheckArgs { python: true, .. } => output::write(&messages::python_module())?,
        CheckArgs { .. } => output::write(&settings::reference())?,
    }
    Ok(())
}

/// Checks a settings file with the files that it names, and prints its processes; or checks a world.
fn check_file(path: &Path) -> anyhow::Result<()> {
    let text = document::read_text(path)?;
    if is_world(&text) {
        let world = world_file::parse(&path.display().to_string(), &text)?;
        output::line(&format!("{}: valid: a world with {} walkers", path.display(), world.walkers.len()))?;
        return Ok(());
    }
    let settings = read(path)?;
    let missing: Vec<String> = missing_programs(&settings).into_iter().chain(missing_devices(&settings)).collect();
    if !missing.is_empty() {
        return Err(BadInput(format!("{}: {}", path.display(), missing.join("; "))).into());
    }
    let processes = settings.process.iter().map(|process| process.name.to_string()).collect::<Vec<_>>().join(", ");
    output::line(&format!("{}: valid: deployment {} with the processes {processes}", path.display(), settings.name))?;
    Ok(())
}

/// The tables by which worlds and settings are told apart: they share `[robot]` only, of which the keys differ.
#[derive(Default, Deserialize)]
#[serde(default)]
struct Tables {
    name: Option<IgnoredAny>,
    process: Option<IgnoredAny>,
    wall: Option<IgnoredAny>,
    #[serde(rename = "box")]
    furniture: Option<IgnoredAny>,
    pillar: Option<IgnoredAny>,
    walker: Option<IgnoredAny>,
    robot: Robot,
}

#[derive(Default, Deserialize)]
#[serde(default)]
struct Robot {
    start_m: Option<IgnoredAny>,
    #[serde(rename = "way")]
    path: Option<IgnoredAny>,
}

/// Whether this text describes a world. What is neither is refused as settings.
fn is_world(text: &str) -> bool {
    let Ok(found) = document::parse::<Tables>("", text) else { return false };
    let parts = [&found.wall, &found.furniture, &found.pillar, &found.walker, &found.robot.start_m, &found.robot.path];
    found.name.is_none() && found.process.is_none() && parts.into_iter().any(Option::is_some)
}

/// Reads settings and checks what their processes would check later.
pub(crate) fn read(path: &Path) -> anyhow::Result<Settings> {
    let settings = Settings::read(path)?;
    check_files(&settings)?;
    Ok(settings)
}

/// Checks the files that settings name.
pub(crate) fn check_files(settings: &Settings) -> anyhow::Result<()> {
    if settings.runs(BuiltIn::Simulator) {
        world_file::read(&settings.simulator.world)?;
    }
    if settings.runs(BuiltIn::Playback) {
        check_log(settings)?;
    }
    Ok(())
}

/// Fails for a log whose first messages cannot be played: playback would pass over all of them, and the processes would wait for ever.
fn check_log(settings: &Settings) -> anyhow::Result<()> {
    let open = || playback::open(&settings.playback);
    open()?.next_of::<SonarScan>()?;
    if settings.runs(BuiltIn::Sbs) {
        open()?.next_picture::<CameraFrame>()?;
    }
    Ok(())
}

/// Fails for settings that name a program that does not exist. A device may appear later: its driver waits for it.
pub(crate) fn check_programs(settings: &Settings) -> Result<(), BadInput> {
    missing_programs(settings).into_iter().next().map_or(Ok(()), |missing| Err(BadInput(missing)))
}

/// The programs that cannot be started, with the reasons.
pub(crate) fn missing_programs(settings: &Settings) -> Vec<String> {
    let commands = settings.process.iter().filter_map(|process| match &process.program {
        Program::Command(words) => Some((&process.name, words.first()?)),
        Program::BuiltIn(_) => None,
    });
    let commands = commands.map(|(name, program)| (format!("process {name}"), program));
    let hook = settings.supervisor.on_event.first().map(|program| ("supervisor.on_event".to_owned(), program));
    commands.chain(hook).filter_map(|(name, program)| find_program(program).err().map(|error| format!("{name}: {error}"))).collect()
}

/// The devices that cannot be opened, with the reasons.
pub(crate) fn missing_devices(settings: &Settings) -> Vec<String> {
    let mut missing = Vec::new();
    match &settings.pioneer.port {
        _ if !settings.runs(BuiltIn::Pioneer) => {}
        Port::Simulator => {}
        Port::Device(port) => missing.extend(device_trouble("pioneer.port", port, "is the robot's cable plugged in?")),
        Port::Network(port) => missing.extend(network_trouble("pioneer.port", port)),
    }
    if settings.runs(BuiltIn::Camera) {
        missing.extend(device_trouble("camera.device", &settings.camera.device, "is the camera plugged in?"));
    }
    missing
}

/// Why nothing accepts connections there.
fn network_trouble(key: &str, NetworkPort { host, port }: &NetworkPort) -> Option<String> {
    let address = Address::Network { host: host.clone(), port: *port };
    Opening::start(&address, 0).wait().err().map(|error| format!("{key} {error}"))
}

fn device_trouble(key: &str, device: &Path, question: &str) -> Option<String> {
    let trouble = |what: String| Some(format!("{key} {}: {what}", device.display()));
    let opened = OpenOptions::new().read(true).write(true).custom_flags(WITHOUT_WAITING.bits() as i32).open(device);
    match opened.and_then(|file| file.metadata()) {
        Ok(found) if found.file_type().is_char_device() => None,
        Ok(_) => trouble("not a device".to_owned()),
        Err(error) if error.kind() == io::ErrorKind::NotFound => trouble(format!("no such device: {question}")),
        Err(error) if error.kind() == io::ErrorKind::PermissionDenied => trouble(format!("{error}: is this user in the device's group?")),
        // Another program uses it. The driver waits for that.
        Err(error) if error.kind() == io::ErrorKind::ResourceBusy => None,
        Err(error) => trouble(error.to_string()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn worlds_and_settings_are_told_apart() {
        let hall = include_str!("../config/worlds/hall.toml");
        for world in [hall, "robot = { start_m = [0, 0] }", "wall = 7", "[[walker]]\nfrom_m = 1"] {
            assert!(is_world(world), "{world}");
        }
        let demo = include_str!("../config/demo.toml");
        for settings in [demo, "", "[robot", "[robot]\nmodel = \"p3-dx\"", "name = \"x\"\nwall = 7"] {
            assert!(!is_world(settings), "{settings}");
        }
    }
}
